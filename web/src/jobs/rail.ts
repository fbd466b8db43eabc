// The list of jobs: as many rows as were fetched, more when the end comes into sight.

import { button, element, h } from "../common/dom";
import { refusal } from "../common/parts";
import type { Feed } from "./feed";
import { Row } from "./row";
import { KINDS, LIST } from "./strings";

export class Rail {
  readonly #feed: Feed;
  readonly #rows = new Map<string, Row>();
  readonly #list = element("list", HTMLUListElement);
  readonly #end = element("list-end", HTMLElement);
  readonly #sight = new IntersectionObserver((entries) => {
    const isSeen = entries.some((entry) => entry.isIntersecting);
    if (isSeen && this.#rows.size > 0) void this.#more();
  });
  readonly #compare: (ids: string[]) => void;
  readonly #marked = new Set<string>();
  #chosen: string | null = null;
  #isRefused = false;

  constructor(feed: Feed, compare: (ids: string[]) => void) {
    this.#feed = feed;
    this.#compare = compare;
    feed.listen({ jobs: (changed) => this.#update(changed) });
    const status = element("filter-status", HTMLSelectElement);
    const kind = element("filter-kind", HTMLSelectElement);
    for (const [value, text] of Object.entries(KINDS)) kind.append(h("option", { value }, text));
    const filter = () => {
      this.#rows.clear();
      this.#list.replaceChildren();
      feed.filter({ status: status.value, kind: kind.value });
      void this.#more();
    };
    status.addEventListener("change", filter);
    kind.addEventListener("change", filter);
    this.#sight.observe(this.#end);
  }

  // Says at the end of the list why it does not go on, until that is tried again.
  refuse(error: unknown): void {
    this.#isRefused = true;
    this.#end.replaceChildren(refusal(error), button(LIST.tryAgain, () => this.#more()));
  }

  async #more(): Promise<void> {
    this.#isRefused = false;
    this.#tellEnd();
    try {
      await this.#feed.more();
    } catch (error) {
      this.refuse(error);
    }
  }

  choose(id: string | null): void {
    if (this.#chosen) this.#rows.get(this.#chosen)?.choose(false);
    this.#chosen = id;
    if (id) this.#rows.get(id)?.choose(true);
  }

  // Whoever looks at a comparison sees what is compared.
  mark(ids: string[]): void {
    this.#marked.clear();
    for (const id of ids) this.#marked.add(id);
    for (const [id, row] of this.#rows) row.mark(this.#marked.has(id));
  }

  #update(changed: Set<string>): void {
    const before = this.#rows.size;
    for (const id of changed) {
      const known = this.#feed.jobs.get(id);
      if (!known) this.#marked.delete(id);
      const job = known && this.#feed.isListed(known) ? known : null;
      const row = this.#rows.get(id);
      if (job && row) {
        row.update(job);
      } else if (job) {
        const made = new Row(job, (on) => this.#toggle(id, on));
        made.choose(id === this.#chosen);
        made.mark(this.#marked.has(id));
        this.#rows.set(id, made);
        this.#insert(id, made.element);
      } else {
        row?.element.remove();
        this.#rows.delete(id);
      }
    }
    if (this.#rows.size > before && !this.#isRefused) this.#lookAgain();
    this.#tellEnd();
  }

  // What is still in sight, or again before a picture was drawn, does not come into sight.
  #lookAgain(): void {
    this.#sight.unobserve(this.#end);
    this.#sight.observe(this.#end);
  }

  #tellEnd(): void {
    if (this.#isRefused) return;
    this.#end.textContent = this.#feed.hasMore ? LIST.more : this.#rows.size === 0 ? LIST.none : "";
  }

  // Ids sort by time, and the newest stands first. Most that come are older than all, or newer.
  #insert(id: string, row: HTMLLIElement): void {
    const idOf = (other: Element | null) => (other as HTMLElement | null)?.dataset["id"] ?? "";
    const last = this.#list.lastElementChild;
    if (!last || idOf(last) > id) this.#list.append(row);
    else this.#list.insertBefore(row, [...this.#list.children].find((other) => idOf(other) < id) ?? null);
  }

  #toggle(id: string, on: boolean): void {
    if (on) this.#marked.add(id);
    else this.#marked.delete(id);
    this.#compare([...this.#marked]);
  }
}
