// Several trainings at once: their courses in the same charts, and in what they differ.

import { h } from "../common/dom";
import { link, refusal, section, table } from "../common/parts";
import { Charts } from "./charts";
import type { Feed } from "./feed";
import { chip, showStatus } from "./parts";
import { COMPARISON } from "./strings";
import { type Job, title } from "./types";
import type { View } from "./view";

export class Comparison implements View {
  readonly element = h("article", {}, h("h1", {}, COMPARISON.title));
  #charts: Charts | null = null;
  #stop: (() => void) | null = null;
  #isClosed = false;

  constructor(feed: Feed, ids: string[]) {
    void this.#open(feed, ids);
  }

  // Compares those that are there, and says why others are not.
  async #open(feed: Feed, ids: string[]): Promise<void> {
    const fetched = await Promise.allSettled(ids.map(async (id) => feed.jobs.get(id) ?? (await feed.fetch(id))));
    if (this.#isClosed) return;
    const jobs = fetched.flatMap((one) => (one.status === "fulfilled" ? [one.value] : []));
    const refused = fetched.flatMap((one) => (one.status === "rejected" ? [refusal(one.reason)] : []));
    this.element.append(...refused);
    if (jobs.length === 0) return;
    this.#charts = new Charts(feed, jobs);
    const chips = new Map(jobs.map(({ id, status }) => [id, chip(status)]));
    this.#stop = feed.listen({
      jobs: (changed) => {
        for (const [id, made] of chips) if (changed.has(id)) showStatus(made, feed.jobs.get(id)?.status ?? "");
      },
    });
    this.element.append(section(COMPARISON.jobs, names(jobs, chips)), section(COMPARISON.differences, differences(jobs)), this.#charts.element);
  }

  close(): void {
    this.#isClosed = true;
    this.#charts?.close();
    this.#stop?.();
  }
}

function names(jobs: Job[], chips: Map<string, HTMLElement>): HTMLElement {
  const name = (job: Job, i: number) =>
    h("li", { class: `series-${(i % 6) + 1}` }, link(`jobs/${job.id}`, title(job)), " ", chips.get(job.id));
  return h("ul", { class: "legend" }, ...jobs.map(name));
}

function differences(jobs: Job[]): HTMLElement {
  const all = [...new Set(jobs.flatMap(({ params }) => Object.keys(params)))];
  const text = (job: Job, name: string) => JSON.stringify(job.params[name] ?? null).replaceAll('"', "");
  const differ = all.filter((name) => new Set(jobs.map((job) => text(job, name))).size > 1);
  if (differ.length === 0) return h("p", { class: "hint" }, COMPARISON.none);
  return table(["", ...jobs.map(title)], differ.map((name) => [name, ...jobs.map((job) => text(job, name))]));
}
