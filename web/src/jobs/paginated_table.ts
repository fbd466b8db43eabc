// Table of a server list, extended page by page.

import { type List, requestJson } from "../common/api";
import { button, h } from "../common/dom";
import { caughtErrorCard } from "../common/components";
import { TABLE } from "./strings";

export interface TableSource<T> {
  // Path with the page size: "datasets?limit=100".
  path: string;
  // Cursor of a record.
  key: (record: T) => string | number;
  table: (page: T[]) => HTMLElement;
  none: string;
}

export class PaginatedTable<T> {
  readonly element = h("div");
  readonly #source: TableSource<T>;
  readonly #more = button(TABLE.more, () => this.#loadNext());
  #last: T | null = null;
  #hasFailed = false;

  constructor(source: TableSource<T>) {
    this.#source = source;
    void this.#open();
  }

  async #open(): Promise<void> {
    this.#hasFailed = false;
    try {
      await this.reload();
    } catch (error) {
      this.#hasFailed = true;
      this.element.replaceChildren(caughtErrorCard(error));
    }
  }

  // Repeats a failed request for the first page.
  retry(): void {
    if (this.#hasFailed) void this.#open();
  }

  // Shows the first page.
  async reload(): Promise<void> {
    const { path, table, none } = this.#source;
    const page = await requestJson<List<T>>(path);
    const content = page.data.length > 0 ? table(page.data) : h("p", { class: "hint" }, none);
    this.element.replaceChildren(content, this.#more);
    this.#setEnd(page);
  }

  async #loadNext(): Promise<void> {
    if (this.#last === null) return;
    const { path, key, table } = this.#source;
    const page = await requestJson<List<T>>(`${path}&after=${key(this.#last)}`);
    this.element.querySelector("tbody")?.append(...table(page.data).querySelectorAll("tbody tr"));
    this.#setEnd(page);
  }

  #setEnd(page: List<T>): void {
    this.#last = page.data.at(-1) ?? null;
    this.#more.hidden = !page.has_more;
  }
}

// All records of a server list.
export async function fetchAll<T extends { id: string }>(path: string): Promise<T[]> {
  const all: T[] = [];
  for (let hasMore = true; hasMore; ) {
    const last = all.at(-1);
    const page = await requestJson<List<T>>(`${path}?limit=100${last ? `&after=${last.id}` : ""}`);
    all.push(...page.data);
    hasMore = page.has_more && page.data.length > 0;
  }
  return all;
}
