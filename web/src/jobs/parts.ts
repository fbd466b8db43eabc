// What several views show of jobs and models.

import { h } from "../common/dom";
import { refusal } from "../common/parts";
import { duration, number } from "../common/numbers";
import { outOf } from "../common/strings";
import { PHASES, PROGRESS, STATUSES } from "./strings";
import type { Job } from "./types";

export function chip(status: string): HTMLElement {
  const made = h("span");
  showStatus(made, status);
  return made;
}

export function showStatus(chip: HTMLElement, status: string): void {
  chip.textContent = STATUSES[status] ?? status;
  chip.className = `chip is-${status}`;
}

// Tells what the buttons in a place were refused: behind the table that they stand in, or behind themselves.
export function tellRefusals(place: HTMLElement): void {
  let card: HTMLElement | null = null;
  place.addEventListener("click", ({ target }) => (target as Element).closest("button") && card?.remove());
  place.addEventListener("refused", (event) => {
    const button = event.target as Element;
    card = refusal((event as CustomEvent<unknown>).detail);
    (button.closest(".scroll") ?? button).after(card);
    event.preventDefault();
  });
}

// What a job is at; a phase that this page does not know in the words of its program.
export function phaseInWords({ phase }: Job): string {
  return PHASES[phase ?? ""] ?? (phase ?? "").replaceAll("_", " ");
}

// "Training: 1,200 of 3,000 steps, 72 a second, 25 s left".
export function progressInWords(job: Job): string {
  const { progress } = job;
  const name = phaseInWords(job);
  if (!progress) return name;
  const unit = progress.unit === "things" ? "" : ` ${progress.unit}`;
  const done = outOf(progress.completed.toLocaleString("en"), progress.total.toLocaleString("en")) + unit;
  const rate = progress.rate_per_second && PROGRESS.rate(number(progress.rate_per_second));
  return `${name}: ${[done, rate, timeLeft(job)].filter(Boolean).join(", ")}`;
}

// Of a running job; only a training is of one part.
export function timeLeft({ kind, status, progress }: Job): string | null {
  if (status !== "running" || progress?.eta_seconds == null) return null;
  const left = duration(progress.eta_seconds);
  return kind.endsWith(".train") ? PROGRESS.left(left) : PROGRESS.leftOfPart(left);
}

// Of a demo that is opened beside this page.
export function demo(query: string, text: string): HTMLElement {
  return h("a", { class: "action", href: `../?${query}`, target: "_blank", rel: "noopener" }, text);
}
