// What somebody should look at in a job: what was told so far, and what comes.

import { ask, type List } from "../common/api";
import { h } from "../common/dom";
import { when } from "../common/numbers";
import { ALERTS } from "./strings";
import type { JobEvent } from "./types";

export class Alerts {
  readonly #list = h("ul");
  readonly element = h("div", { class: "alerts", role: "status", "aria-label": ALERTS.title, hidden: true }, this.#list);
  readonly #job: string;
  readonly #rows = new Map<number, HTMLElement>();

  constructor(job: string) {
    this.#job = job;
    void this.fetch();
  }

  // Those so far, and those that were missed meanwhile; where they cannot be had, the connection is told to be lost.
  async fetch(): Promise<void> {
    for (let after = "", hasMore = true; hasMore; ) {
      const page = await ask<List<JobEvent>>(`jobs/${this.#job}/events?type=alert${after}`).catch(() => null);
      for (const event of page?.data ?? []) this.add(event);
      hasMore = page?.has_more ?? false;
      after = `&after=${page?.data.at(-1)?.id}`;
    }
  }

  add({ seq, created_at, message }: JobEvent): void {
    if (this.#rows.has(seq)) return;
    this.#rows.set(seq, h("li", {}, h("time", { datetime: created_at }, when(created_at)), message));
    const inOrder = [...this.#rows].sort(([a], [b]) => a - b);
    this.#list.replaceChildren(...inOrder.map(([, row]) => row));
    this.element.hidden = false;
    // What scrolls is reached by keyboard, too.
    this.element.tabIndex = 0;
  }
}
