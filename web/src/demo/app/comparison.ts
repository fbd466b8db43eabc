// Comparison with a second policy: same object, pose and seed in a second worker and view.

import { element } from "../../common/dom";
import { fillWithModels } from "../panel/policy_options";
import type { View } from "../view/view";
import type { FailureEvent, WorkerRequest } from "../worker/messages";
import type { Outcome } from "../worker/protocol";
import { asSecondary, isFatal, loadModelRequest, WorkerClient } from "../worker/worker_client";
import { EventBus } from "./event_bus";
import { COMPARISON } from "./strings";

export interface ComparisonEvents {
  // Requests that bring a new worker to the state of the first one.
  stateRequests(): WorkerRequest[];
  // Creates the second view, which shows the events of this bus; null if nothing can be rendered.
  createView(bus: EventBus): View | null;
  // Camera of the first view.
  cameraView(): number[] | null;
  report(failure: FailureEvent): void;
}

// Requests that are not sent to the second worker.
const FIRST_ONLY = new Set<WorkerRequest["kind"]>(["loadModel", "exportRecording", "streamTelemetry", "searchGrasps", "playGrasps"]);

// Requests that end the current attempt and discard its outcome.
const ENDS_ATTEMPT = new Set<WorkerRequest["kind"]>(["loadObject", "upload", "place", "placeBySeed", "grasp", "reset"]);

export class Comparison {
  readonly #page: EventBus;
  readonly #events: ComparisonEvents;
  // Events of the second worker.
  readonly #second = new EventBus();
  readonly #select = element("compare", HTMLSelectElement);
  readonly #names = [element("policy-name-1", HTMLElement), element("policy-name-2", HTMLElement)] as const;
  #client: WorkerClient | null = null;
  #view: View | null = null;
  #first = "";
  // Whether the second policy is loaded. An attempt requested earlier waits for it; otherwise the planner
  // would run.
  #isReady = false;
  #waitingGrasp: WorkerRequest | null = null;
  // Request of the last attempt, unless a later request has ended it.
  #attempt: WorkerRequest | null = null;

  constructor(page: EventBus, events: ComparisonEvents) {
    [this.#page, this.#events] = [page, events];
    this.#select.addEventListener("change", () => this.#start(this.#select.value));
    fillWithModels(this.#select, page);
    page.on("sent", ({ request }) => this.#send(request));
    page.on("model", ({ id }) => this.#setFirst(id));
    page.on("outcome", (outcome) => this.#showOutcome(outcome));
    page.on("cameraMoved", ({ camera }) => {
      if (this.#client) this.#view?.setView(camera);
    });
    this.#connectSecond();
  }

  #connectSecond(): void {
    const second = this.#second;
    second.on("model", ({ id }) => {
      // The reason was already reported as a failure.
      if (id === null) this.#start((this.#select.value = ""));
      else this.#onModelLoaded();
    });
    second.on("outcome", ({ playback, text }) => {
      this.#names[1].textContent = `${playback?.description ?? this.#select.value}: ${text}`;
    });
    second.on("attemptFinished", (attempt) => this.#page.emit({ kind: "secondAttemptFinished", attempt }));
    second.on("batchFinished", ({ batchId }) => this.#page.emit({ kind: "secondBatchFinished", batchId }));
    second.on("failure", (failure) => {
      if (isFatal(failure)) this.#start((this.#select.value = ""));
      this.#events.report(asSecondary(failure, COMPARISON.closed));
    });
  }

  // Sets the name of the first policy.
  #setFirst(id: string | null): void {
    this.#first = id ?? COMPARISON.planner;
    this.#names[0].textContent = this.#first;
  }

  // Names of the policies that run a batch.
  get names(): string[] {
    const second = this.#select.value;
    if (!this.#client || !this.#isReady) return [this.#first];
    return [this.#first, second === this.#first ? COMPARISON.second(second) : second];
  }

  // Forwards a request of the first worker to the second one.
  #send(request: WorkerRequest): void {
    // The name replaces the outcome of the previous attempt.
    if (request.kind === "playGrasps") this.#names[0].textContent = this.#first;
    if (FIRST_ONLY.has(request.kind) || !this.#client) return;
    // A batch that starts before the second policy is loaded runs only with the first one.
    if (request.kind === "batch" && !this.#isReady) return;
    if (ENDS_ATTEMPT.has(request.kind)) {
      [this.#waitingGrasp, this.#attempt] = [null, request.kind === "grasp" ? request : null];
    }
    if (request.kind === "grasp" && !this.#isReady) this.#waitingGrasp = request;
    else this.#client.send(request);
    if (ENDS_ATTEMPT.has(request.kind)) this.#showNames();
  }

  // Loads the object in the orientation that the first worker has chosen, then repeats the current attempt.
  reorient(object: WorkerRequest): void {
    const attempt = this.#attempt;
    this.#send(object);
    if (attempt) this.#send(attempt);
  }

  // The first worker was restarted.
  restart(): void {
    if (this.#client) this.#start(this.#select.value);
  }

  // Shows the outcome of the first policy or of a playback.
  #showOutcome({ text, playback }: Outcome): void {
    this.#names[0].textContent = `${playback?.description ?? this.#first}: ${text}`;
  }

  #showNames(): void {
    this.#names[0].textContent = this.#first;
    const second = this.#select.value;
    this.#names[1].textContent = this.#isReady || second === "" ? second : COMPARISON.loading(second);
  }

  #start(id: string): void {
    if (this.#client) this.#page.emit({ kind: "secondBatchFinished", batchId: null });
    this.#client?.terminate();
    [this.#client, this.#isReady, this.#waitingGrasp, this.#attempt] = [null, false, null, null];
    document.body.classList.toggle("is-compared", id !== "");
    this.#showNames();
    if (id === "") return;
    if (!this.#view) this.#createView();
    const client = new WorkerClient(loadModelRequest(id), (event) => this.#second.emit(event));
    this.#client = client;
    for (const request of this.#events.stateRequests()) client.send(request);
  }

  #onModelLoaded(): void {
    this.#isReady = true;
    this.#showNames();
    if (this.#waitingGrasp) this.#client?.send(this.#waitingGrasp);
    this.#waitingGrasp = null;
  }

  #createView(): void {
    const view = this.#events.createView(this.#second);
    if (!view) return;
    this.#view = view;
    // Subscribed after the view, which starts with the default camera.
    this.#second.on("ready", () => {
      const camera = this.#events.cameraView();
      if (camera) view.setView(camera);
    });
  }
}
