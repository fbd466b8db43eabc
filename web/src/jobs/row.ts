// A job in the list. It changes in place: what is replaced under the pointer cannot be clicked.

import { h } from "../common/dom";
import { duration, when } from "../common/numbers";
import { phaseInWords, showStatus, timeLeft } from "./parts";
import { KINDS, LIST, PROGRESS } from "./strings";
import { ENDED, type Job, title } from "./types";

export class Row {
  readonly element: HTMLLIElement;
  readonly #name = h("strong");
  readonly #chip = h("span");
  readonly #about = h("span", { class: "hint" });
  readonly #note = h("span", { class: "hint is-number" });
  readonly #bar = h("progress", { max: 1, "aria-label": PROGRESS.title });
  readonly #link: HTMLAnchorElement;
  readonly #mark: HTMLInputElement;

  constructor(job: Job, marked: (on: boolean) => void) {
    this.#mark = h("input", { type: "checkbox", change: () => marked(this.#mark.checked) });
    this.#link = h("a", { href: `#jobs/${job.id}` }, this.#name, this.#chip, this.#about, this.#note, this.#bar);
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
    const phase = (!job.name || job.status === "running") && phaseInWords(job);
    this.#about.textContent = [kind, phase].filter(Boolean).join(": ");
    this.#note.textContent = note(job);
    this.#bar.hidden = ENDED.includes(job.status) || !job.progress;
    if (job.progress) this.#bar.value = job.progress.fraction;
  }

  choose(on: boolean): void {
    if (on) this.#link.setAttribute("aria-current", "true");
    else this.#link.removeAttribute("aria-current");
  }

  mark(on: boolean): void {
    this.#mark.checked = on;
  }
}

// How long yet, how long it took, or when it was asked for.
function note(job: Job): string {
  const { started_at, finished_at, created_at } = job;
  const left = timeLeft(job);
  if (left) return left;
  if (started_at && finished_at) return duration((Date.parse(finished_at) - Date.parse(started_at)) / 1000);
  return when(created_at);
}
