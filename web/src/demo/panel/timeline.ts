// Timeline of an attempt: phase buttons and a slider over its ticks.

import { element } from "../../common/dom";
import { PLAYBACK } from "../app/strings";
import type { Frame, WorkerRequest } from "../worker/protocol";

// Control period (s).
const TICK_S = 1 / 30;

export class Timeline {
  readonly #send: (request: WorkerRequest) => void;
  readonly #slider = element("timeline", HTMLInputElement);
  readonly #phases = [...element("phases", HTMLOListElement).querySelectorAll("button")];
  #frame: Frame | null = null;
  #isDragged = false;

  constructor(send: (request: WorkerRequest) => void) {
    this.#send = send;
    this.#slider.addEventListener("input", () => this.seek(this.#slider.valueAsNumber));
    this.#slider.addEventListener("pointerdown", ({ button }) => (this.#isDragged = button === 0));
    for (const end of ["pointerup", "pointercancel"]) addEventListener(end, () => (this.#isDragged = false));
    for (const button of this.#phases) {
      button.addEventListener("click", () => {
        const tick = this.#startTick(button);
        if (tick !== undefined) this.seek(tick);
      });
    }
  }

  // First tick of a button's phase, if the attempt has reached it.
  #startTick(button: HTMLElement): number | undefined {
    return this.#frame?.phaseStarts.find(([phase]) => phase === button.parentElement?.dataset["phase"])?.[1];
  }

  seek(tick: number): void {
    this.#send({ kind: "seek", tick: Math.max(0, tick) });
  }

  seekBy(ticks: number): void {
    if (this.#frame) this.seek(Math.min(this.#frame.ticks, this.#frame.tick + ticks));
  }

  show(frame: Frame): void {
    this.#frame = frame;
    const { tick, ticks } = frame;
    setEnabled(this.#slider, ticks > 0);
    this.#slider.max = String(Math.max(1, ticks));
    if (!this.#isDragged) this.#slider.value = String(tick);
    this.#slider.setAttribute("aria-valuetext", PLAYBACK.time((tick * TICK_S).toFixed(2), (ticks * TICK_S).toFixed(2)));
    element("clock", HTMLElement).textContent = ticks > 0 ? `${(tick * TICK_S).toFixed(1)} s` : "";
    for (const button of this.#phases) setEnabled(button, this.#startTick(button) !== undefined);
  }
}

// A focused control is not disabled: it would lose focus, and its arrow keys would move the object.
function setEnabled(control: HTMLInputElement | HTMLButtonElement, on: boolean): void {
  control.disabled = !on && control !== document.activeElement;
}
