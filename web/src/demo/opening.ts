// The first minute: a recording plays at once, then the policy shows itself. Whoever does anything ends that.

import recording from "./recording.json?url";
import type { ToWorker, Verdict } from "./protocol";

// Between the verdict of the recording and the first attempt (ms).
const PAUSE = 1500;

// What is asked of that which goes on, and ends nothing.
const PASSIVE = new Set<ToWorker["kind"]>(["watch", "pause", "resume", "speed"]);
// What puts something on the table, or tries it.
const BEGINNINGS = new Set<ToWorker["kind"]>(["load", "place", "randomPose", "grasp", "batch", "follow"]);

export interface OpeningEvents {
  play(file: File): void;
  grasp(): void;
}

export class Opening {
  readonly #events: OpeningEvents;
  #isOn: boolean;
  #hasModel = false;
  #isOver = false;
  // Whether something was put on the table or tried, but for what the address asks for.
  isBegun = false;

  constructor(isWanted: boolean, events: OpeningEvents) {
    this.#isOn = isWanted;
    this.#events = events;
  }

  async ready(): Promise<void> {
    if (!this.#isOn) return;
    const answer = await fetch(recording).catch(() => null);
    const played = answer?.ok ? await answer.blob().catch(() => null) : null;
    // Somebody may have begun while it came.
    if (!this.#isOn || this.#isOver) return;
    if (played) this.#events.play(new File([played], "recording.json"));
    else this.end();
  }

  hasModel(): void {
    this.#hasModel = true;
    this.#go();
  }

  showVerdict({ played }: Verdict): void {
    if (played && this.#isOn) setTimeout(() => this.end(), PAUSE);
  }

  // This is asked of the worker.
  asked(kind: ToWorker["kind"]): void {
    if (!PASSIVE.has(kind)) this.stop();
    this.isBegun ||= BEGINNINGS.has(kind);
  }

  // Somebody brings an object.
  brought(): void {
    this.stop();
    this.isBegun = true;
  }

  // Somebody has taken over.
  stop(): void {
    this.#isOn = false;
  }

  // Nothing is played, or no more.
  end(): void {
    this.#isOver = true;
    this.#go();
  }

  #go(): void {
    if (!this.#isOn || !this.#hasModel || !this.#isOver) return;
    this.#isOn = false;
    this.#events.grasp();
  }
}
