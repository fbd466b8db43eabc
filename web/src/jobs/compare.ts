// Several trainings at once: their courses in the same charts, and in what they differ.

import { h } from "../common/dom";
import { link, refusal, section, table } from "../common/parts";
import { Charts } from "./charts";
import type { Feed } from "./feed";
import { chip } from "./parts";
import { COMPARISON } from "./strings";
import { type Job, title } from "./types";
import type { View } from "./view";

export class Comparison implements View {
  readonly element = h("article", {}, h("h1", {}, COMPARISON.title));
  #charts: Charts | null = null;
  #isClosed = false;

  constructor(feed: Feed, ids: string[]) {
    const fetched = Promise.all(ids.map((id) => feed.jobs.get(id) ?? feed.fetch(id)));
    fetched.then(
      (jobs) => {
        if (this.#isClosed) return;
        this.#charts = new Charts(feed, jobs);
        this.element.append(section(COMPARISON.jobs, names(jobs)), section(COMPARISON.differences, differences(jobs)), this.#charts.element);
      },
      (error: unknown) => this.element.append(refusal(error)),
    );
  }

  close(): void {
    this.#isClosed = true;
    this.#charts?.close();
  }
}

function names(jobs: Job[]): HTMLElement {
  const name = (job: Job, i: number) =>
    h("li", { class: `series-${(i % 6) + 1}` }, link(`jobs/${job.id}`, title(job)), " ", chip(job.status));
  return h("ul", { class: "legend" }, ...jobs.map(name));
}

function differences(jobs: Job[]): HTMLElement {
  const all = [...new Set(jobs.flatMap(({ params }) => Object.keys(params)))];
  const text = (job: Job, name: string) => JSON.stringify(job.params[name] ?? null).replaceAll('"', "");
  const differ = all.filter((name) => new Set(jobs.map((job) => text(job, name))).size > 1);
  if (differ.length === 0) return h("p", { class: "hint" }, COMPARISON.none);
  return table(["", ...jobs.map(title)], differ.map((name) => [name, ...jobs.map((job) => text(job, name))]));
}
