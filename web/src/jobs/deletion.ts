// A deletion that can be taken back for a while.

import { button, h } from "../common/dom";
import { JOB } from "./strings";

// For so long (ms).
const REGRET = 6000;

export class Deletion {
  readonly element = h("div", { role: "status" });
  readonly #act: () => Promise<void>;
  readonly #leave = () => this.settle();
  #timer = 0;

  constructor(act: () => Promise<void>) {
    this.#act = act;
  }

  // There is one at a time, however often it is asked for.
  begin(): void {
    if (this.#timer) return;
    const undo = button(JOB.undo, () => this.cancel());
    this.element.replaceChildren(h("p", { class: "toast" }, JOB.deleted, undo));
    this.#timer = window.setTimeout(() => this.settle(), REGRET);
    addEventListener("pagehide", this.#leave);
  }

  // Takes it back, if it has begun, and says so.
  cancel(): void {
    this.element.replaceChildren(...(this.#timer ? [h("p", { class: "toast" }, JOB.kept)] : []));
    this.#stopWaiting();
  }

  // Carries it out, if it has begun: nobody has taken it back, or nobody can any more.
  settle(): void {
    if (!this.#timer) return;
    this.#stopWaiting();
    this.element.replaceChildren();
    void this.#act();
  }

  #stopWaiting(): void {
    clearTimeout(this.#timer);
    this.#timer = 0;
    removeEventListener("pagehide", this.#leave);
  }
}
