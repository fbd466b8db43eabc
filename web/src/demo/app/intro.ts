// Introduction: replays a recording until the policy is loaded, then runs an attempt of the policy. Any user
// action ends it.

import type { WorkerRequest } from "../worker/messages";
import type { Model, Outcome } from "../worker/protocol";
import type { EventBus } from "./event_bus";
import recordingUrl from "./recording.json?url";

// Delay between the outcome of the recording and an attempt of the planner (ms).
const PAUSE_MS = 1500;

// Requests that do not end the introduction.
const PASSIVE = new Set<WorkerRequest["kind"]>(["streamTelemetry", "pause", "resume", "speed"]);
// Requests that change the object or start an attempt.
const INTERACTIONS = new Set<WorkerRequest["kind"]>(["loadObject", "place", "placeBySeed", "grasp", "batch", "playGrasps"]);

// Requests after which the object would still be at the pose of the recording.
const KEEPS_POSE = new Set<WorkerRequest["kind"]>(["grasp", "loadObject", "reset", "playGrasps"]);

export interface IntroEvents {
  // Whether a recording may fill the time until the policy is loaded. It does not replace a requested policy.
  playsRecording: boolean;
  play(file: File): void;
  // Runs the first attempt at the pose of its seed.
  grasp(): void;
  // Places the object at the pose of the seed.
  placeBySeed(): void;
}

export class Intro {
  readonly #events: IntroEvents;
  #isActive: boolean;
  #hasModel = false;
  #isRecordingFinished = false;
  // Whether the object is at the pose of the recording, which the user has not chosen.
  #isAtRecordedPose = false;
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
    if (!this.#isActive || !this.#events.playsRecording) return;
    const response = await fetch(recordingUrl).catch(() => null);
    const recording = response?.ok ? await response.blob().catch(() => null) : null;
    // The user may have acted, or the policy may have been loaded, during the download.
    if (!this.#isActive || this.#isRecordingFinished) return;
    if (!recording) return this.#finishRecording();
    this.#isAtRecordedPose = true;
    this.#events.play(new File([recording], "recording.json"));
  }

  // A policy replaces the recording at once. The planner, used without a policy, waits for its end.
  hasModel({ id }: Model): void {
    this.#hasModel = true;
    this.#isRecordingFinished ||= id !== null;
    this.#startWhenReady();
  }

  #showOutcome({ playback }: Outcome): void {
    if (playback && this.#isActive) setTimeout(() => this.#finishRecording(), PAUSE_MS);
  }

  #onRequest(kind: WorkerRequest["kind"]): void {
    if (!PASSIVE.has(kind)) this.stop();
    this.hasUserActed ||= INTERACTIONS.has(kind);
    if (KEEPS_POSE.has(kind)) this.#leaveRecordedPose();
    if (kind === "place" || kind === "placeBySeed") this.#isAtRecordedPose = false;
  }

  #onUpload(): void {
    this.stop();
    this.hasUserActed = true;
    this.#leaveRecordedPose();
  }

  #leaveRecordedPose(): void {
    if (!this.#isAtRecordedPose) return;
    this.#isAtRecordedPose = false;
    this.#events.placeBySeed();
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
