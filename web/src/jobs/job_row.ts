// Row of the job list, updated in place: an element that is replaced under the pointer cannot be clicked.

import { h } from "../common/dom";
import { dateTime, duration } from "../common/numbers";
import { phaseText, showStatus, timeLeft } from "./components";
import { KINDS } from "./kinds";
import { LIST, PROGRESS } from "./strings";
import { ENDED, type Job, title } from "./types";

export class JobRow {
  readonly element: HTMLLIElement;
  readonly #name = h("strong");
  readonly #chip = h("span");
  readonly #description = h("span", { class: "hint" });
  readonly #time = h("span", { class: "hint is-number" });
  readonly #bar = h("progress", { max: 1, "aria-label": PROGRESS.title });
  readonly #link: HTMLAnchorElement;
  readonly #mark: HTMLInputElement;

  constructor(job: Job, onMark: (isMarked: boolean) => void) {
    this.#mark = h("input", { type: "checkbox", change: () => onMark(this.#mark.checked) });
    this.#link = h("a", { href: `#jobs/${job.id}` }, this.#name, this.#chip, this.#description, this.#time, this.#bar);
    const isTraining = job.kind.endsWith(".train");
    this.element = h(
      "li",
      { class: "row", "data-id": job.id },
      isTraining && h("label", { class: "mark" }, this.#mark),
      this.#link,
    );
    this.update(job);
  }

  update(job: Job): void {
    this.#name.textContent = title(job);
    this.#mark.setAttribute("aria-label", LIST.compare(title(job)));
    showStatus(this.#chip, job.status);
    const kind = job.name && (KINDS[job.kind] ?? job.kind);
    const phase = (!job.name || job.status === "running") && phaseText(job);
    this.#description.textContent = [kind, phase].filter(Boolean).join(": ");
    this.#time.textContent = timeText(job);
    this.#bar.hidden = ENDED.includes(job.status) || !job.progress;
    if (job.progress) this.#bar.value = job.progress.fraction;
  }

  choose(isChosen: boolean): void {
    if (isChosen) this.#link.setAttribute("aria-current", "true");
    else this.#link.removeAttribute("aria-current");
  }

  mark(isMarked: boolean): void {
    this.#mark.checked = isMarked;
  }
}

// Remaining time of a running job, duration of an ended one, otherwise the creation time.
function timeText(job: Job): string {
  const { started_at, finished_at, created_at } = job;
  const left = timeLeft(job);
  if (left) return left;
  if (started_at && finished_at) return duration((Date.parse(finished_at) - Date.parse(started_at)) / 1000);
  return dateTime(created_at);
}
