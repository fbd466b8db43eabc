// Pause, step, reset, speed, the moment that is shown, and how fast it really runs.

import { element } from "../../common/dom";
import type { Frame, ToWorker } from "../protocol";
import { PLAYBACK } from "../strings";
import { Timeline } from "./timeline";

// Slower than this share of what was asked for is worth pointing out.
const SLOW = 0.9;

export class Playback {
  readonly #send: (message: ToWorker) => void;
  readonly #pause = element("pause", HTMLButtonElement);
  readonly #back = element("back", HTMLButtonElement);
  readonly #step = element("step", HTMLButtonElement);
  readonly #reset = element("reset", HTMLButtonElement);
  readonly #speed = element("speed", HTMLSelectElement);
  readonly #rate = element("rate", HTMLElement);
  readonly #timeline: Timeline;
  #isRunning = true;
  #isSuspended = false;

  constructor(send: (message: ToWorker) => void) {
    this.#send = send;
    this.#timeline = new Timeline(send);
    this.#back.addEventListener("click", () => this.back());
    this.#pause.addEventListener("click", () => this.toggle());
    this.#step.addEventListener("click", () => this.step());
    this.#reset.addEventListener("click", () => this.reset());
    this.#speed.addEventListener("change", () => send({ kind: "speed", factor: Number(this.#speed.value) }));
  }

  enable(): void {
    this.#setDisabled(false);
  }

  disable(): void {
    this.#setDisabled(true);
  }

  #setDisabled(on: boolean): void {
    for (const control of [this.#pause, this.#back, this.#step, this.#reset, this.#speed]) control.disabled = on;
  }

  toggle(): void {
    this.#send({ kind: this.#isRunning ? "pause" : "resume" });
  }

  // Pauses for as long as the page is hidden, unless it was paused anyway.
  suspend(on: boolean): void {
    if (on === this.#isSuspended || (on && !this.#isRunning)) return;
    this.#isSuspended = on;
    this.#send({ kind: on ? "pause" : "resume" });
  }

  step(): void {
    this.#send({ kind: "step" });
  }

  back(): void {
    this.#timeline.go(-1);
  }

  // Shows how it was after this tick.
  seek(tick: number): void {
    this.#timeline.seek(tick);
  }

  reset(): void {
    this.#send({ kind: "reset" });
  }

  show(frame: Frame): void {
    const { running, factor, measured } = frame;
    this.#timeline.show(frame);
    this.#isRunning = running;
    this.#pause.classList.toggle("is-paused", !running);
    this.#pause.setAttribute("aria-label", running ? PLAYBACK.pause : PLAYBACK.goOn);
    this.#speed.value = String(factor);
    const isMeasured = running && measured !== null;
    this.#rate.textContent = isMeasured ? PLAYBACK.rate(measured.toFixed(2)) : running ? "" : PLAYBACK.paused;
    this.#rate.classList.toggle("is-slow", isMeasured && measured < SLOW * factor);
  }
}
