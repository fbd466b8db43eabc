// Deletion with an undo period.

import { button, h } from "../common/dom";
import { JOB } from "./strings";

const UNDO_PERIOD_MS = 6000;

export class UndoableDelete {
  readonly element = h("div", { role: "status" });
  readonly #delete: () => Promise<void>;
  readonly #onPageHide = () => this.commit();
  #timer = 0;

  constructor(act: () => Promise<void>) {
    this.#delete = act;
  }

  // Starts the undo period, unless one is running.
  start(): void {
    if (this.#timer) return;
    const undo = button(JOB.undo, () => this.cancel());
    this.element.replaceChildren(h("p", { class: "toast" }, JOB.willBeDeleted, undo));
    this.#timer = window.setTimeout(() => this.commit(), UNDO_PERIOD_MS);
    addEventListener("pagehide", this.#onPageHide);
  }

  // Cancels a pending deletion and confirms that to the user.
  cancel(): void {
    this.element.replaceChildren(...(this.#timer ? [h("p", { class: "toast" }, JOB.deletionCancelled)] : []));
    this.#stopTimer();
  }

  // Executes a pending deletion: the undo period is over, or the user leaves the page or view.
  commit(): void {
    if (!this.#timer) return;
    this.#stopTimer();
    this.element.replaceChildren();
    void this.#delete();
  }

  #stopTimer(): void {
    clearTimeout(this.#timer);
    this.#timer = 0;
    removeEventListener("pagehide", this.#onPageHide);
  }
}
