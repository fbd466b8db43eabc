// Table of the attempts of a batch, each with a replay button.

import { element, h } from "../../common/dom";
import { BATCH } from "../app/strings";
import type { BatchAttempt } from "../worker/protocol";
import { insertBySeed } from "./seed_order";

export class AttemptTable {
  readonly #details = element("attempts-all", HTMLDetailsElement);
  readonly #rows = element("attempts-rows", HTMLTableSectionElement);
  readonly #replay: (seed: number) => void;

  constructor(replay: (seed: number) => void) {
    this.#replay = replay;
  }

  // `policy`: name of the policy, or null if the batch has only one.
  add({ seed, pose, lifted, text, time }: BatchAttempt, policy: string | null): void {
    this.#details.hidden = false;
    const button = h("button", { type: "button", class: "quiet", click: () => this.#replay(seed) }, String(seed));
    button.setAttribute("aria-label", BATCH.replaySeed(seed));
    const number = (value: number) => h("td", { class: "is-number" }, value.toFixed(0));
    const row = h(
      "tr",
      { class: lifted ? null : "is-failed" },
      h("td", {}, button),
      number(100 * pose.x),
      number(100 * pose.y),
      number((180 / Math.PI) * pose.yaw),
      h("td", {}, policy === null ? text : BATCH.ofPolicy(policy, text)),
      h("td", { class: "is-number" }, time.toFixed(1)),
    );
    insertBySeed(this.#rows, row, seed);
  }

  clear(): void {
    this.#details.hidden = true;
    this.#rows.replaceChildren();
  }
}
