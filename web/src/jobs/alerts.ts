// Alerts of a job, past and new.

import { type List, requestJson } from "../common/api";
import { h } from "../common/dom";
import { dateTime } from "../common/numbers";
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

  // Fetches past and missed alerts. Errors need no message: the page shows the lost connection.
  async fetch(): Promise<void> {
    for (let after = "", hasMore = true; hasMore; ) {
      const page = await requestJson<List<JobEvent>>(`jobs/${this.#job}/events?type=alert${after}`).catch(() => null);
      for (const event of page?.data ?? []) this.add(event);
      hasMore = page?.has_more ?? false;
      after = `&after=${page?.data.at(-1)?.id}`;
    }
  }

  add({ seq, created_at, message }: JobEvent): void {
    if (this.#rows.has(seq)) return;
    this.#rows.set(seq, h("li", {}, h("time", { datetime: created_at }, dateTime(created_at)), message));
    const inOrder = [...this.#rows].sort(([a], [b]) => a - b);
    this.#list.replaceChildren(...inOrder.map(([, row]) => row));
    this.element.hidden = false;
    // A scrollable element must be focusable by keyboard.
    this.element.tabIndex = 0;
  }
}
