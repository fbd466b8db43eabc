// The models that a training wrote on its way, newest first; each can be tried while it goes on.

import { ask, type List } from "../common/api";
import { h } from "../common/dom";
import { link, section, table } from "../common/parts";
import { number, size } from "../common/words";
import { demo } from "./parts";
import type { Checkpoint } from "./types";

export class Checkpoints {
  readonly element: HTMLElement;
  readonly #body: HTMLTableSectionElement;
  readonly #seen = new Set<string>();

  constructor(job: string) {
    const empty = table(["Step", "Loss", "", "", "Model", "Size"], [], [0, 1]);
    this.#body = empty.querySelector("tbody")!;
    this.element = section("Checkpoints", empty);
    this.element.hidden = true;
    const fetched = ask<List<Checkpoint>>(`jobs/${job}/checkpoints`);
    fetched.then(({ data }) => data.forEach((one) => this.add(one))).catch(() => {});
  }

  add({ step, model_id, bytes, metrics }: Checkpoint): void {
    const key = `${step} ${model_id}`;
    if (this.#seen.has(key)) return;
    this.#seen.add(key);
    this.element.hidden = false;
    const loss = metrics["loss"];
    const cells = [
      step.toLocaleString("en"),
      typeof loss === "number" ? number(loss) : "",
      demo(`model=${model_id}`, "Try in demo"),
      link(`new?kind=policy.evaluate&model_id=${model_id}`, "Evaluate"),
      link(`models/${model_id}`, model_id),
      size(bytes),
    ];
    this.#body.prepend(h("tr", {}, ...cells.map((cell, i) => h("td", { class: i < 2 ? "is-number" : null }, cell))));
  }
}
