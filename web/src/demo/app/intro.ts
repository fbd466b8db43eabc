// Introduction: replays a recording, then runs an attempt of the policy. Any user action ends it.

import type { Outcome, WorkerRequest } from "../worker/protocol";
import type { EventBus } from "./event_bus";
import recordingUrl from "./recording.json?url";

// Delay between the outcome of the recording and the first attempt (ms).
const PAUSE_MS = 1500;

// Requests that do not end the introduction.
const PASSIVE = new Set<WorkerRequest["kind"]>(["streamTelemetry", "pause", "resume", "speed"]);
// Requests that change the object or start an attempt.
const INTERACTIONS = new Set<WorkerRequest["kind"]>(["loadObject", "place", "placeBySeed", "grasp", "batch", "playGrasps"]);

export interface IntroEvents {
  play(file: File): void;
  grasp(): void;
}

export class Intro {
  readonly #events: IntroEvents;
  #isActive: boolean;
  #hasModel = false;
  #isRecordingFinished = false;
  // Whether the user has loaded or placed an object or started an attempt. The file of the URL does not
  // count.
  hasUserActed = false;

  constructor(bus: EventBus, isEnabled: boolean, events: IntroEvents) {
    this.#isActive = isEnabled;
    this.#events = events;
    bus.on("requested", ({ request }) => this.#onRequest(request.kind));
    bus.on("fileSelected", () => this.#onUpload());
    bus.on("outcome", (outcome) => this.#showOutcome(outcome));
    bus.on("stopped", () => this.stop());
    // The recording may be of another scene.
    bus.on("failure", ({ code }) => {
      if (code === "invalid_recording") this.#finishRecording();
    });
  }

  async ready(): Promise<void> {
    if (!this.#isActive) return;
    const response = await fetch(recordingUrl).catch(() => null);
    const recording = response?.ok ? await response.blob().catch(() => null) : null;
    // The user may have acted during the download.
    if (!this.#isActive || this.#isRecordingFinished) return;
    if (recording) this.#events.play(new File([recording], "recording.json"));
    else this.#finishRecording();
  }

  hasModel(): void {
    this.#hasModel = true;
    this.#startWhenReady();
  }

  #showOutcome({ playback }: Outcome): void {
    if (playback && this.#isActive) setTimeout(() => this.#finishRecording(), PAUSE_MS);
  }

  #onRequest(kind: WorkerRequest["kind"]): void {
    if (!PASSIVE.has(kind)) this.stop();
    this.hasUserActed ||= INTERACTIONS.has(kind);
  }

  #onUpload(): void {
    this.stop();
    this.hasUserActed = true;
  }

  stop(): void {
    this.#isActive = false;
  }

  // The recording has ended or cannot be replayed.
  #finishRecording(): void {
    this.#isRecordingFinished = true;
    this.#startWhenReady();
  }

  #startWhenReady(): void {
    if (!this.#isActive || !this.#hasModel || !this.#isRecordingFinished) return;
    this.#isActive = false;
    this.#events.grasp();
  }
}
