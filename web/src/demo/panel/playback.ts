// Playback controls: pause, step, reset, speed, timeline, measured real-time factor.

import { element } from "../../common/dom";
import type { EventBus } from "../app/event_bus";
import { PLAYBACK } from "../app/strings";
import type { WorkerRequest } from "../worker/messages";
import type { Frame } from "../worker/protocol";
import { Timeline } from "./timeline";

// Below this fraction of the requested speed, the real-time factor is highlighted.
const SLOW_FRACTION = 0.9;

export class Playback {
  readonly #send: (request: WorkerRequest) => void;
  readonly #pause = element("pause", HTMLButtonElement);
  readonly #back = element("back", HTMLButtonElement);
  readonly #step = element("step", HTMLButtonElement);
  readonly #reset = element("reset", HTMLButtonElement);
  readonly #speed = element("speed", HTMLSelectElement);
  readonly #rate = element("rate", HTMLElement);
  readonly #timeline: Timeline;
  #isRunning = true;
  #isSuspended = false;

  constructor(bus: EventBus, send: (request: WorkerRequest) => void) {
    this.#send = send;
    this.#timeline = new Timeline(send);
    this.#back.addEventListener("click", () => this.back());
    this.#pause.addEventListener("click", () => this.toggle());
    this.#step.addEventListener("click", () => this.step());
    this.#reset.addEventListener("click", () => this.reset());
    this.#speed.addEventListener("change", () => send({ kind: "speed", factor: Number(this.#speed.value) }));
    bus.on("ready", () => this.#setDisabled(false));
    bus.on("frame", (frame) => this.#show(frame));
    bus.on("stopped", () => this.#setDisabled(true));
  }

  #setDisabled(on: boolean): void {
    for (const control of [this.#pause, this.#back, this.#step, this.#reset, this.#speed]) control.disabled = on;
  }

  toggle(): void {
    this.#send({ kind: this.#isRunning ? "pause" : "resume" });
  }

  // Pauses while the page is hidden, unless already paused by the user.
  suspend(on: boolean): void {
    if (on === this.#isSuspended || (on && !this.#isRunning)) return;
    this.#isSuspended = on;
    this.#send({ kind: on ? "pause" : "resume" });
  }

  step(): void {
    this.#send({ kind: "step" });
  }

  back(): void {
    this.#timeline.seekBy(-1);
  }

  seek(tick: number): void {
    this.#timeline.seek(tick);
  }

  reset(): void {
    this.#send({ kind: "reset" });
  }

  #show(frame: Frame): void {
    const { running, speed, realtimeFactor } = frame;
    this.#timeline.show(frame);
    this.#isRunning = running;
    this.#pause.classList.toggle("is-paused", !running);
    this.#pause.setAttribute("aria-label", running ? PLAYBACK.pause : PLAYBACK.resume);
    this.#speed.value = String(speed);
    const isMeasured = running && realtimeFactor !== null;
    this.#rate.textContent = isMeasured ? PLAYBACK.rate(realtimeFactor.toFixed(2)) : running ? "" : PLAYBACK.paused;
    this.#rate.classList.toggle("is-slow", isMeasured && realtimeFactor < SLOW_FRACTION * speed);
  }
}
