// Job list with infinite scrolling.

import { button, element, h } from "../common/dom";
import { caughtErrorCard } from "../common/components";
import type { JobFeed } from "./job_feed";
import { JobRow } from "./job_row";
import { KINDS } from "./kinds";
import { LIST } from "./strings";

export class JobList {
  readonly #feed: JobFeed;
  readonly #rows = new Map<string, JobRow>();
  readonly #list = element("job-rows", HTMLUListElement);
  readonly #end = element("job-list-end", HTMLElement);
  readonly #endObserver = new IntersectionObserver((entries) => {
    const isVisible = entries.some((entry) => entry.isIntersecting);
    if (isVisible && this.#rows.size > 0) void this.#loadMore();
  });
  readonly #compare: (ids: string[]) => void;
  readonly #marked = new Set<string>();
  #chosen: string | null = null;
  #hasError = false;

  constructor(feed: JobFeed, compare: (ids: string[]) => void) {
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
      void this.#loadMore();
    };
    status.addEventListener("change", filter);
    kind.addEventListener("change", filter);
    this.#endObserver.observe(this.#end);
  }

  // Shows a loading error at the end of the list, with a retry button.
  showError(error: unknown): void {
    this.#hasError = true;
    this.#end.replaceChildren(caughtErrorCard(error), button(LIST.retry, () => this.#loadMore()));
  }

  async #loadMore(): Promise<void> {
    this.#hasError = false;
    this.#showEnd();
    try {
      await this.#feed.loadMore();
    } catch (error) {
      this.showError(error);
    }
  }

  choose(id: string | null): void {
    if (this.#chosen) this.#rows.get(this.#chosen)?.choose(false);
    this.#chosen = id;
    if (id) this.#rows.get(id)?.choose(true);
  }

  // Checks the rows of the jobs that are compared.
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
        const created = new JobRow(job, (isMarked) => this.#toggle(id, isMarked));
        created.choose(id === this.#chosen);
        created.mark(this.#marked.has(id));
        this.#rows.set(id, created);
        this.#insert(id, created.element);
      } else {
        row?.element.remove();
        this.#rows.delete(id);
      }
    }
    if (this.#rows.size > before && !this.#hasError) this.#observeAgain();
    this.#showEnd();
  }

  // The observer does not report an end that stays visible, or that leaves and returns within one frame.
  #observeAgain(): void {
    this.#endObserver.unobserve(this.#end);
    this.#endObserver.observe(this.#end);
  }

  #showEnd(): void {
    if (this.#hasError) return;
    this.#end.textContent = this.#feed.hasMore ? LIST.loading : this.#rows.size === 0 ? LIST.none : "";
  }

  // Ids sort by time; the newest job is first. Most new rows belong at one end.
  #insert(id: string, row: HTMLLIElement): void {
    const idOf = (other: Element | null) => (other as HTMLElement | null)?.dataset["id"] ?? "";
    const last = this.#list.lastElementChild;
    if (!last || idOf(last) > id) this.#list.append(row);
    else this.#list.insertBefore(row, [...this.#list.children].find((other) => idOf(other) < id) ?? null);
  }

  #toggle(id: string, isMarked: boolean): void {
    if (isMarked) this.#marked.add(id);
    else this.#marked.delete(id);
    this.#compare([...this.#marked]);
  }
}
