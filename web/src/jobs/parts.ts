// What several views show of jobs and models.

import { h } from "../common/dom";
import { table } from "../common/parts";
import { duration, label, number, percent } from "../common/numbers";
import { outOf } from "../common/strings";
import { EVALUATION, PROGRESS } from "./strings";
import type { Evaluation, Job } from "./types";

export function chip(status: string): HTMLElement {
  return h("span", { class: `chip is-${status}` }, status);
}

// "training: 1,200 of 3,000 steps, 72 a second, 25 s left".
export function progressInWords(job: Job): string {
  const { progress, phase } = job;
  const name = (phase ?? "").replaceAll("_", " ");
  if (!progress) return name;
  const done = `${outOf(progress.completed.toLocaleString("en"), progress.total.toLocaleString("en"))} ${progress.unit}`;
  const rate = progress.rate_per_second && PROGRESS.rate(number(progress.rate_per_second));
  const left = job.status === "running" && progress.eta_seconds !== null && PROGRESS.left(duration(progress.eta_seconds));
  return `${name}: ${[done, rate, left].filter(Boolean).join(", ")}`;
}

// How often what was lifted.
export function evaluations(reports: Evaluation[]): HTMLElement {
  const rows = reports.map((report) => [
    label(report.object),
    report.policy,
    share(report),
    outOf(report.lifted, report.attempts),
    `${percent(report.wilson95[0])} – ${percent(report.wilson95[1])}`,
    Object.entries(report.failures)
      .map(([reason, count]) => `${count} ${reason.replaceAll("_", " ")}`)
      .join(", "),
    String(report.seed),
  ]);
  return table(EVALUATION.head, rows, [3]);
}

// A bar from 0 to 1 with its interval.
function share({ lifted, attempts, wilson95 }: Evaluation): HTMLElement {
  const [band, mark] = [h("span"), h("i")];
  band.style.left = `${100 * wilson95[0]}%`;
  band.style.right = `${100 * (1 - wilson95[1])}%`;
  mark.style.left = `${(100 * lifted) / Math.max(1, attempts)}%`;
  return h("div", { class: "interval", "aria-hidden": "true" }, band, mark);
}

// Of a demo that is opened beside this page.
export function demo(query: string, text: string): HTMLElement {
  return h("a", { class: "action", href: `../?${query}`, target: "_blank", rel: "noopener" }, text);
}
