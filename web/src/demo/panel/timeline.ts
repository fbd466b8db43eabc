// The course of an attempt: its phases, and a slider that shows any moment of it again.

import { element } from "../../common/dom";
import type { Frame, ToWorker } from "../protocol";
import { PLAYBACK } from "../strings";

// A control period (s).
const TICK = 1 / 30;

export class Timeline {
  readonly #send: (message: ToWorker) => void;
  readonly #slider = element("timeline", HTMLInputElement);
  readonly #phases = [...element("phases", HTMLOListElement).querySelectorAll("button")];
  #frame: Frame | null = null;
  #isHeld = false;

  constructor(send: (message: ToWorker) => void) {
    this.#send = send;
    this.#slider.addEventListener("input", () => this.seek(this.#slider.valueAsNumber));
    this.#slider.addEventListener("pointerdown", ({ button }) => (this.#isHeld = button === 0));
    for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => (this.#isHeld = false));
    for (const button of this.#phases) {
      button.addEventListener("click", () => {
        const tick = this.#begin(button);
        if (tick !== undefined) this.seek(tick);
      });
    }
  }

  // The tick at which a button's phase began, if there was one.
  #begin(button: HTMLElement): number | undefined {
    return this.#frame?.marks.find(([phase]) => phase === button.parentElement?.dataset["phase"])?.[1];
  }

  seek(tick: number): void {
    this.#send({ kind: "seek", tick: Math.max(0, tick) });
  }

  // By so many ticks.
  go(by: number): void {
    if (this.#frame) this.seek(Math.min(this.#frame.ticks, this.#frame.tick + by));
  }

  show(frame: Frame): void {
    this.#frame = frame;
    const { tick, ticks } = frame;
    enable(this.#slider, ticks > 0);
    this.#slider.max = String(Math.max(1, ticks));
    if (!this.#isHeld) this.#slider.value = String(tick);
    this.#slider.setAttribute("aria-valuetext", PLAYBACK.moment((tick * TICK).toFixed(2), (ticks * TICK).toFixed(2)));
    element("clock", HTMLElement).textContent = ticks > 0 ? `${(tick * TICK).toFixed(1)} s` : "";
    for (const button of this.#phases) enable(button, this.#begin(button) !== undefined);
  }
}

// What has the focus keeps it: the next key would be the object's.
function enable(control: HTMLInputElement | HTMLButtonElement, on: boolean): void {
  control.disabled = !on && control !== document.activeElement;
}

