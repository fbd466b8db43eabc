// Comparison of training jobs: shared charts and a table of differing parameters.

import { h } from "../common/dom";
import { caughtErrorCard, link, section, table } from "../common/components";
import { Charts } from "./charts";
import { showStatus, statusChip } from "./components";
import type { JobFeed } from "./job_feed";
import { COMPARISON } from "./strings";
import { type Job, title } from "./types";
import type { View } from "./main_view";

export class Comparison implements View {
  readonly element = h("article");
  readonly #feed: JobFeed;
  readonly #ids: string[];
  // A job could not be fetched.
  #hasFailed = false;
  #charts: Charts | null = null;
  #unsubscribe: (() => void) | null = null;
  #isClosed = false;

  constructor(feed: JobFeed, ids: string[]) {
    [this.#feed, this.#ids] = [feed, ids];
    void this.#open();
  }

  retry(): void {
    if (!this.#hasFailed) return;
    this.#release();
    void this.#open();
  }

  // Compares the jobs that could be fetched and shows an error for each other one.
  async #open(): Promise<void> {
    this.#hasFailed = false;
    const feed = this.#feed;
    const fetched = await Promise.allSettled(this.#ids.map(async (id) => feed.jobs.get(id) ?? (await feed.fetch(id))));
    if (this.#isClosed) return;
    const jobs = fetched.flatMap((result) => (result.status === "fulfilled" ? [result.value] : []));
    const errors = fetched.flatMap((result) => (result.status === "rejected" ? [caughtErrorCard(result.reason)] : []));
    this.#hasFailed = errors.length > 0;
    this.element.replaceChildren(h("h1", {}, COMPARISON.title), ...errors);
    if (jobs.length === 0) return;
    this.#charts = new Charts(feed, jobs);
    const chips = new Map(jobs.map(({ id, status }) => [id, statusChip(status)]));
    this.#unsubscribe = feed.listen({
      jobs: (changed) => {
        for (const [id, chip] of chips) if (changed.has(id)) showStatus(chip, feed.jobs.get(id)?.status ?? "");
      },
    });
    this.element.append(section(COMPARISON.jobs, legend(jobs, chips)), section(COMPARISON.differences, differences(jobs)), this.#charts.element);
  }

  close(): void {
    this.#isClosed = true;
    this.#release();
  }

  #release(): void {
    this.#charts?.close();
    this.#unsubscribe?.();
  }
}

function legend(jobs: Job[], chips: Map<string, HTMLElement>): HTMLElement {
  const item = (job: Job, i: number) =>
    h("li", { class: `series-${(i % 6) + 1}` }, link(`jobs/${job.id}`, title(job)), " ", chips.get(job.id));
  return h("ul", { class: "legend" }, ...jobs.map(item));
}

function differences(jobs: Job[]): HTMLElement {
  const names = [...new Set(jobs.flatMap(({ params }) => Object.keys(params)))];
  const text = (job: Job, name: string) => JSON.stringify(job.params[name] ?? null).replaceAll('"', "");
  const differing = names.filter((name) => new Set(jobs.map((job) => text(job, name))).size > 1);
  if (differing.length === 0) return h("p", { class: "hint" }, COMPARISON.identical);
  return table(["", ...jobs.map(title)], differing.map((name) => [name, ...jobs.map((job) => text(job, name))]));
}
