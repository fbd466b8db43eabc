// All attempts of a row as a table, with a button that shows each of them again.

import { element, h } from "../../common/dom";
import type { Attempted } from "../protocol";
import { BATCH } from "../strings";

export class AttemptTable {
  readonly #whole = element("attempts-all", HTMLDetailsElement);
  readonly #rows = element("attempts-rows", HTMLTableSectionElement);
  readonly #replay: (seed: number) => void;

  constructor(replay: (seed: number) => void) {
    this.#replay = replay;
  }

  // An attempt, and who made it if that is to be told.
  add({ seed, pose, lifted, words, time }: Attempted, name: string | null): void {
    this.#whole.hidden = false;
    const button = h("button", { type: "button", class: "quiet", click: () => this.#replay(seed) }, String(seed));
    button.setAttribute("aria-label", BATCH.watchSeed(seed));
    const number = (value: number) => h("td", { class: "is-number" }, value.toFixed(0));
    const row = h(
      "tr",
      { class: lifted ? null : "is-failed" },
      h("td", {}, button),
      number(100 * pose.x),
      number(100 * pose.y),
      number((180 / Math.PI) * pose.yaw),
      h("td", {}, name === null ? words : BATCH.of(name, words)),
      h("td", { class: "is-number" }, time.toFixed(1)),
    );
    this.#rows.append(row);
  }

  clear(): void {
    this.#whole.hidden = true;
    this.#rows.replaceChildren();
  }
}
