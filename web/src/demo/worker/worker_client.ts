// Client of a Web Worker: starts and restarts it, queues requests until it is ready, reports its fatal
// errors.

import { ERRORS } from "../app/strings";
import { acquireWorker } from "./early_worker";
import type { FailureEvent, WorkerRequest } from "./messages";
import type { WorkerEvent } from "./protocol";

export function loadModelRequest(id: string, onlyIfIdle = false): WorkerRequest {
  return { kind: "loadModel", id, base: new URL(".", document.baseURI).href, onlyIfIdle };
}

// Whether the worker is unusable after this failure.
export function isFatal({ code }: FailureEvent): boolean {
  return code.startsWith("worker_");
}

// A policy could not be downloaded; the request can be repeated.
export const DOWNLOAD_FAILED = "model_download_failed";

// FailureEvent of a secondary worker that its owner has already terminated. The changed code offers no restart or
// retry.
export function asSecondary(failure: FailureEvent, hint: string): FailureEvent {
  return isFatal(failure) || failure.code === DOWNLOAD_FAILED ? { ...failure, code: `second_${failure.code}`, hint } : failure;
}

export class WorkerClient {
  #worker: Worker;
  // Requests queued until the worker is ready; null afterwards.
  #queue: WorkerRequest[] | null;
  #startRequest: WorkerRequest;
  readonly #onEvent: (event: WorkerEvent) => void;

  // `startRequest` is sent first to every worker.
  constructor(startRequest: WorkerRequest, onEvent: (event: WorkerEvent) => void) {
    this.#startRequest = startRequest;
    this.#queue = [startRequest];
    this.#onEvent = onEvent;
    this.#worker = this.#start();
  }

  // Bytes are copied, not transferred, so that the same request can be sent to several workers.
  send(request: WorkerRequest): void {
    if (this.#queue) this.#queue.push(request);
    else this.#worker.postMessage(request);
  }

  // Sends a request now and first to every later worker.
  sendOnStart(request: WorkerRequest): void {
    this.#startRequest = request;
    if (this.#queue) this.#queue[0] = request;
    else this.send(request);
  }

  // Sends a request first to every later worker, but not to the current one.
  setStartRequest(request: WorkerRequest): void {
    this.#startRequest = request;
  }

  terminate(): void {
    this.#worker.terminate();
  }

  // Replaces the worker, for example after a fatal failure.
  restart(): void {
    this.#worker.terminate();
    this.#queue = [this.#startRequest];
    this.#worker = this.#start();
  }

  #flush(): void {
    const queue = this.#queue ?? [];
    this.#queue = null;
    for (const request of queue) this.#worker.postMessage(request);
  }

  #start(): Worker {
    // A panic is reported as a failure event first, then as an error event.
    let hasFailed = false;
    const onMessage = ({ data }: MessageEvent<WorkerEvent>) => {
      hasFailed ||= data.kind === "failure" && isFatal(data);
      this.#onEvent(data);
      if (data.kind === "ready") this.#flush();
    };
    return acquireWorker(onMessage, (event) => {
      event.preventDefault();
      if (!hasFailed) this.#onEvent({ kind: "failure", code: "worker_stopped", ...ERRORS.stopped(event.message) });
    });
  }
}
