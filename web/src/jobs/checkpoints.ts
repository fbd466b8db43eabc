// Checkpoints of a training job, newest first. Each can be tried while training continues.

import { type List, requestJson } from "../common/api";
import { h } from "../common/dom";
import { caughtErrorCard, link, section, table } from "../common/components";
import { byteSize, number } from "../common/numbers";
import { demoLink } from "./components";
import { CHECKPOINTS, DEMO } from "./strings";
import type { Checkpoint } from "./types";

export class Checkpoints {
  readonly element: HTMLElement;
  readonly #body: HTMLTableSectionElement;
  readonly #known = new Set<string>();
  readonly #job: string;
  readonly #error = h("div");
  // Rows to insert when the pointer leaves the table. A row inserted now would move the link under the pointer.
  #waiting: HTMLTableRowElement[] = [];

  constructor(job: string) {
    this.#job = job;
    const empty = table(CHECKPOINTS.head, [], [0, 1, 2]);
    this.#body = empty.querySelector("tbody")!;
    // After a tap, the pointer leaves before the click is dispatched.
    this.#body.addEventListener("pointerleave", () => setTimeout(() => this.#insertWaiting()));
    this.element = section(CHECKPOINTS.title, empty, this.#error);
    this.element.hidden = true;
    void this.fetch();
  }

  // Fetches past and missed checkpoints.
  async fetch(): Promise<void> {
    try {
      const { data } = await requestJson<List<Checkpoint>>(`jobs/${this.#job}/checkpoints`);
      this.#error.replaceChildren();
      for (const checkpoint of data) this.add(checkpoint);
    } catch (error) {
      this.#error.replaceChildren(caughtErrorCard(error));
      this.element.hidden = false;
    }
  }

  add({ step, model_id, bytes, metrics }: Checkpoint): void {
    const key = `${step} ${model_id}`;
    if (this.#known.has(key)) return;
    this.#known.add(key);
    this.element.hidden = false;
    const loss = metrics["loss"];
    const cells = [
      step.toLocaleString("en"),
      typeof loss === "number" ? number(loss) : "",
      byteSize(bytes),
      link(`models/${model_id}`, model_id),
      demoLink(`model=${model_id}&training=${this.#job}`, DEMO.tryIn),
      link(`new?kind=policy.evaluate&model_id=${model_id}`, CHECKPOINTS.evaluate),
    ];
    const row = h("tr", { "data-step": step }, ...cells.map((cell, i) => h("td", { class: i < 3 ? "is-number" : null }, cell)));
    this.#waiting.push(row);
    if (!this.#body.matches(":hover")) this.#insertWaiting();
  }

  #insertWaiting(): void {
    const stepOf = (row: HTMLTableRowElement) => Number(row.dataset["step"]);
    for (const row of this.#waiting.splice(0)) {
      const next = [...this.#body.rows].find((other) => stepOf(other) <= stepOf(row));
      this.#body.insertBefore(row, next ?? null);
    }
  }
}
