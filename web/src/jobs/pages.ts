// A list of the server in a table that grows page by page.

import { ask, type List } from "../common/api";
import { button, h } from "../common/dom";
import { refusal } from "../common/parts";
import { PAGES } from "./strings";

export interface Listed<T> {
  // With the length of a page: "datasets?limit=100".
  path: string;
  // By what the server knows where a page ended.
  key: (one: T) => string | number;
  table: (page: T[]) => HTMLElement;
  none: string;
}

export class Pages<T> {
  readonly element = h("div");
  readonly #listed: Listed<T>;
  readonly #more = button(PAGES.more, () => this.#next());
  #last: T | null = null;

  constructor(listed: Listed<T>) {
    this.#listed = listed;
    this.begin().catch((error: unknown) => this.element.replaceChildren(refusal(error)));
  }

  // From the first page on.
  async begin(): Promise<void> {
    const { path, table, none } = this.#listed;
    const page = await ask<List<T>>(path);
    const shown = page.data.length > 0 ? table(page.data) : h("p", { class: "hint" }, none);
    this.element.replaceChildren(shown, this.#more);
    this.#ended(page);
  }

  async #next(): Promise<void> {
    if (this.#last === null) return;
    const { path, key, table } = this.#listed;
    const page = await ask<List<T>>(`${path}&after=${key(this.#last)}`);
    this.element.querySelector("tbody")?.append(...table(page.data).querySelectorAll("tbody tr"));
    this.#ended(page);
  }

  #ended(page: List<T>): void {
    this.#last = page.data.at(-1) ?? null;
    this.#more.hidden = !page.has_more;
  }
}

// All of a list, to choose from.
export async function everyPage<T extends { id: string }>(path: string): Promise<T[]> {
  const all: T[] = [];
  for (let more = true; more; ) {
    const last = all.at(-1);
    const page = await ask<List<T>>(`${path}?limit=100${last ? `&after=${last.id}` : ""}`);
    all.push(...page.data);
    more = page.has_more && page.data.length > 0;
  }
  return all;
}
