// Workers of one grasp search. The page's worker decides on batches of tasks; these workers execute them.

import type { FailureEvent, WorkerRequest } from "./messages";
import type { SearchBatch, WorkerEvent } from "./protocol";
import { WorkerClient } from "./worker_client";

// Workers per search. More than the cores would slow down the attempt in the view.
const MAX_WORKERS = 4;
const MIN_WORKERS = 2;

export interface SearchWorkersEvents {
  // All tasks of the batch have these results.
  complete(results: Uint8Array[]): void;
  report(failure: FailureEvent): void;
}

export class SearchWorkers {
  readonly #events: SearchWorkersEvents;
  readonly #taskOf: (index: number, task: Uint8Array) => WorkerRequest;
  readonly #workers: WorkerClient[];
  #tasks: Uint8Array[] = [];
  #results: Uint8Array[] = [];
  #numStarted = 0;
  #numDone = 0;

  // `object` are the bytes of the object from the first batch.
  constructor(object: Uint8Array, seed: number, isLong: boolean, events: SearchWorkersEvents) {
    this.#events = events;
    this.#taskOf = (index, task) => ({ kind: "runSearchTask", seed, isLong, index, task });
    const count = Math.min(MAX_WORKERS, Math.max(MIN_WORKERS, navigator.hardwareConcurrency - 1));
    this.#workers = Array.from({ length: count }, (_, worker) => {
      return new WorkerClient({ kind: "loadObjectBytes", object }, (event) => this.#onEvent(worker, event));
    });
  }

  run({ tasks }: SearchBatch): void {
    [this.#tasks, this.#results, this.#numStarted, this.#numDone] = [tasks, [], 0, 0];
    this.#workers.forEach((_, worker) => this.#startNext(worker));
  }

  terminate(): void {
    for (const worker of this.#workers) worker.terminate();
  }

  #startNext(worker: number): void {
    const index = this.#numStarted;
    const task = this.#tasks[index];
    if (!task) return;
    this.#numStarted += 1;
    this.#workers[worker]?.send(this.#taskOf(index, task));
  }

  #onEvent(worker: number, event: WorkerEvent): void {
    if (event.kind === "failure") this.#events.report(event);
    if (event.kind !== "searchTaskDone") return;
    this.#results[event.index] = event.result;
    this.#numDone += 1;
    if (this.#numDone === this.#tasks.length) this.#events.complete(this.#results);
    else this.#startNext(worker);
  }
}
