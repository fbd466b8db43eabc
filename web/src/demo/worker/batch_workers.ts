// Workers that help with a batch. The page's worker owns the batch and counts its attempts; these workers take seeds of it.

import type { FailureEvent, WorkerRequest } from "./messages";
import type { WorkerEvent } from "./protocol";
import { loadModelRequest, WorkerClient } from "./worker_client";

// Workers of a batch, with the page's worker. More than the cores would slow each of them down.
const MAX_WORKERS = 4;

export function numBatchWorkers(): number {
  return Math.min(MAX_WORKERS, Math.max(2, navigator.hardwareConcurrency));
}

export interface BatchWorkersEvents {
  // Sends a request to the page's worker.
  send(request: WorkerRequest): void;
  report(failure: FailureEvent): void;
}

export class BatchWorkers {
  readonly #batchId: number;
  readonly #modelHash: string;
  readonly #events: BatchWorkersEvents;
  readonly #workers: WorkerClient[];
  // Workers with the policy, which take part.
  readonly #ready = new Set<number>();

  // `object` are the bytes of the object on the table.
  constructor(batchId: number, object: Uint8Array, model: { id: string; hash: string }, events: BatchWorkersEvents) {
    [this.#batchId, this.#modelHash, this.#events] = [batchId, model.hash, events];
    this.#workers = Array.from({ length: numBatchWorkers() - 1 }, (_, worker) => {
      const client = new WorkerClient({ kind: "loadObjectBytes", object }, (event) => this.#onEvent(worker, event));
      client.send(loadModelRequest(model.id));
      return client;
    });
  }

  // The seeds that this worker has requested.
  run(worker: number, seed: number, attempts: number): void {
    if (attempts > 0) this.#workers[worker]?.send({ kind: "batch", seed, attempts, batchId: this.#batchId, workers: 1 });
    else this.#workers[worker]?.terminate();
  }

  terminate(): void {
    for (const worker of this.#workers) worker.terminate();
  }

  #onEvent(worker: number, event: WorkerEvent): void {
    const isReady = this.#ready.has(worker);
    // Without the same policy, for example because it has changed on the server, the other workers run all attempts.
    if (!isReady && (event.kind === "failure" || (event.kind === "model" && event.hash !== this.#modelHash))) {
      this.#workers[worker]?.terminate();
    } else if (event.kind === "model" || event.kind === "batchFinished") {
      this.#ready.add(worker);
      this.#events.send({ kind: "takeAttempts", batchId: this.#batchId, worker });
    } else if (event.kind === "attemptFinished") {
      this.#events.send({ kind: "countAttempt", batchId: this.#batchId, attempt: event.attempt });
    } else if (event.kind === "failure") this.#events.report(event);
  }
}
