// The models that a training wrote on its way, newest first; each can be tried while it goes on.

import { ask, type List } from "../common/api";
import { h } from "../common/dom";
import { link, refusal, section, table } from "../common/parts";
import { number, size } from "../common/numbers";
import { demo } from "./parts";
import { CHECKPOINTS, DEMO } from "./strings";
import type { Checkpoint } from "./types";

export class Checkpoints {
  readonly element: HTMLElement;
  readonly #body: HTMLTableSectionElement;
  readonly #seen = new Set<string>();
  readonly #job: string;
  // Why they could not be had.
  readonly #notice = h("div");

  constructor(job: string) {
    this.#job = job;
    const empty = table(CHECKPOINTS.head, [], [0, 1, 2]);
    this.#body = empty.querySelector("tbody")!;
    this.element = section(CHECKPOINTS.title, empty, this.#notice);
    this.element.hidden = true;
    void this.fetch();
  }

  // Those so far, and those that were missed meanwhile.
  async fetch(): Promise<void> {
    try {
      const { data } = await ask<List<Checkpoint>>(`jobs/${this.#job}/checkpoints`);
      this.#notice.replaceChildren();
      for (const one of data) this.add(one);
    } catch (error) {
      this.#notice.replaceChildren(refusal(error));
      this.element.hidden = false;
    }
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
      size(bytes),
      link(`models/${model_id}`, model_id),
      demo(`model=${model_id}&training=${this.#job}`, DEMO.tryIn),
      link(`new?kind=policy.evaluate&model_id=${model_id}`, CHECKPOINTS.evaluate),
    ];
    const row = h("tr", { "data-step": step }, ...cells.map((cell, i) => h("td", { class: i < 3 ? "is-number" : null }, cell)));
    this.#body.insertBefore(row, [...this.#body.rows].find((other) => Number(other.dataset["step"]) <= step) ?? null);
  }
}
