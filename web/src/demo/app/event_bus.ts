// Events of the page, keyed by kind. A panel subscribes to the events that it shows; handlers of one kind run
// in the order of their subscription.

import type { Layer } from "../view/view";
import type { WorkerRequest } from "../worker/messages";
import type { AttemptFinished, Model, WorkerEvent } from "../worker/protocol";

// The events of the first worker, and those of the page itself.
export type PageEvent =
  | WorkerEvent
  // The object differs from the previous one in shape, mass or friction.
  | { kind: "objectChanged" }
  // The policy differs from the previous one.
  | { kind: "modelChanged"; model: Model }
  // The worker cannot be used until a new one is ready.
  | { kind: "stopped"; headline: string }
  // The user or the URL has made a request, which may wait for a file that is being read.
  | { kind: "requested"; request: WorkerRequest }
  // A request was sent to the first worker.
  | { kind: "sent"; request: WorkerRequest }
  // The user has selected a file to upload.
  | { kind: "fileSelected" }
  | { kind: "layerSwitched"; layer: Layer; on: boolean }
  // Camera of the first view.
  | { kind: "cameraMoved"; camera: number[] }
  // Attempt of the second policy in a batch, and the end of that batch; null is the current batch.
  | { kind: "secondAttemptFinished"; attempt: AttemptFinished }
  | { kind: "secondBatchFinished"; batchId: number | null };

type Kind = PageEvent["kind"];
type EventOf<K extends Kind> = Extract<PageEvent, { kind: K }>;

export class EventBus {
  readonly #handlers = new Map<Kind, ((event: never) => void)[]>();

  on<K extends Kind>(kind: K, handler: (event: EventOf<K>) => void): void {
    const handlers = this.#handlers.get(kind);
    if (handlers) handlers.push(handler);
    else this.#handlers.set(kind, [handler]);
  }

  emit<K extends Kind>(event: EventOf<K>): void {
    // `on` pairs each kind with the handlers of its events.
    const handlers = this.#handlers.get(event.kind) as ((event: EventOf<K>) => void)[] | undefined;
    handlers?.forEach((handler) => handler(event));
  }
}
