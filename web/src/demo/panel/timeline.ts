// Timeline of an attempt: phase buttons and a slider over its ticks.

import { element } from "../../common/dom";
import { PLAYBACK } from "../app/strings";
import type { WorkerRequest } from "../worker/messages";
import type { Frame } from "../worker/protocol";

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
    const outcomeTick = frame.phaseStarts.find(([phase]) => phase === "outcome")?.[1] ?? Infinity;
    const seconds = (count: number, digits: number) => (count * TICK_S).toFixed(digits);
    // The time after the outcome belongs to no attempt, so it is counted from there.
    const after = tick - outcomeTick;
    const text = after > 0 ? PLAYBACK.afterOutcomeText(seconds(after, 2)) : PLAYBACK.time(seconds(tick, 2), seconds(ticks, 2));
    this.#slider.setAttribute("aria-valuetext", text);
    const clock = after > 0 ? PLAYBACK.afterOutcome(seconds(after, 1)) : `${seconds(tick, 1)} s`;
    element("clock", HTMLElement).textContent = ticks > 0 ? clock : "";
    for (const button of this.#phases) setEnabled(button, this.#startTick(button) !== undefined);
  }
}

// A focused control is not disabled: it would lose focus, and its arrow keys would move the object.
function setEnabled(control: HTMLInputElement | HTMLButtonElement, on: boolean): void {
  control.disabled = !on && control !== document.activeElement;
}
