// Components and texts that several views of the Jobs page share.

import { h } from "../common/dom";
import { caughtErrorCard } from "../common/components";
import { duration, number } from "../common/numbers";
import { outOf } from "../common/strings";
import { PHASES, PROGRESS, STATUSES } from "./strings";
import type { Job } from "./types";

export function statusChip(status: string): HTMLElement {
  const chip = h("span");
  showStatus(chip, status);
  return chip;
}

export function showStatus(chip: HTMLElement, status: string): void {
  chip.textContent = STATUSES[status] ?? status;
  chip.className = `chip is-${status}`;
}

// Shows errors of the buttons in `container` below the button, or below the table that contains it.
export function showActionErrors(container: HTMLElement): void {
  let card: HTMLElement | null = null;
  container.addEventListener("click", ({ target }) => (target as Element).closest("button") && card?.remove());
  container.addEventListener("action-error", (event) => {
    const button = event.target as Element;
    card = caughtErrorCard((event as CustomEvent<unknown>).detail);
    (button.closest(".scroll") ?? button).after(card);
    event.preventDefault();
  });
}

// Current phase of a job. Phases unknown to this page are shown by the worker's name.
export function phaseText({ phase }: Job): string {
  return PHASES[phase ?? ""] ?? (phase ?? "").replaceAll("_", " ");
}

// "Training: 1,200 of 3,000 steps, 72/s, 25 s left".
export function progressText(job: Job): string {
  const { progress } = job;
  const name = phaseText(job);
  if (!progress) return name;
  const unit = progress.unit === "items" ? "" : ` ${progress.unit}`;
  const done = outOf(progress.completed.toLocaleString("en"), progress.total.toLocaleString("en")) + unit;
  const rate = progress.rate_per_second && PROGRESS.rate(number(progress.rate_per_second));
  return `${name}: ${[done, rate, timeLeft(job)].filter(Boolean).join(", ")}`;
}

// Remaining time of a running job. Only training jobs have a single phase.
export function timeLeft({ kind, status, progress }: Job): string | null {
  if (status !== "running" || progress?.eta_seconds == null) return null;
  const left = duration(progress.eta_seconds);
  return kind.endsWith(".train") ? PROGRESS.left(left) : PROGRESS.leftOfPhase(left);
}

// Link that opens the demo in a new tab.
export function demoLink(query: string, text: string): HTMLElement {
  return h("a", { class: "action", href: `../?${query}`, target: "_blank", rel: "noopener" }, text);
}
