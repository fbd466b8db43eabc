// Grasp search without a policy: samples grasps in a separate worker and starts an attempt with the best one.

import { element } from "../../common/dom";
import type { EventBus } from "../app/event_bus";
import { SEARCH } from "../app/strings";
import type { FailureEvent } from "../worker/messages";
import type { GraspsFound, WorkerEvent, WorkerRequest } from "../worker/protocol";
import { asSecondary, WorkerClient } from "../worker/worker_client";

export interface GraspSearchEvents {
  // Requests that bring a new worker to the state of the first one.
  stateRequests(): WorkerRequest[];
  seed(): number;
  // Starts an attempt with these grasps.
  play(found: GraspsFound): void;
  report(failure: FailureEvent): void;
}

export class GraspSearchPanel {
  readonly #events: GraspSearchEvents;
  readonly #button = element("search", HTMLButtonElement);
  readonly #bar = element("search-bar", HTMLProgressElement);
  readonly #status = element("search-status", HTMLElement);
  #client: WorkerClient | null = null;
  // Grasps found for the current object.
  #found: GraspsFound | null = null;

  constructor(bus: EventBus, events: GraspSearchEvents) {
    this.#events = events;
    bus.on("objectChanged", () => this.#clear());
    this.#button.addEventListener("click", () => {
      if (this.#client) this.#stop(SEARCH.stopped);
      else if (this.#found) events.play(this.#found);
      else this.#start();
    });
    this.#clear();
  }

  // Discards the grasps of the previous object.
  #clear(): void {
    this.#found = null;
    this.#button.disabled = this.#events.stateRequests().length === 0;
    this.#stop(SEARCH.hint);
  }

  #start(): void {
    const [object, ...rest] = this.#events.stateRequests();
    if (!object) return;
    const client = new WorkerClient(object, (event) => this.#onEvent(event));
    this.#client = client;
    for (const request of rest) client.send(request);
    client.send({ kind: "searchGrasps", seed: this.#events.seed() });
    this.#button.textContent = SEARCH.stop;
    this.#bar.hidden = false;
    this.#bar.removeAttribute("value");
    this.#status.textContent = SEARCH.testing;
  }

  #stop(status: string): void {
    this.#client?.terminate();
    this.#client = null;
    this.#bar.hidden = true;
    this.#button.textContent = this.#found ? SEARCH.replay : SEARCH.start;
    this.#status.textContent = status;
  }

  #onEvent(event: WorkerEvent): void {
    if (event.kind === "progress" && event.total !== null) {
      [this.#bar.max, this.#bar.value] = [event.total, event.done];
    } else if (event.kind === "graspsFound") {
      this.#found = event.count > 0 ? event : null;
      this.#stop(event.text);
      if (this.#found) this.#events.play(this.#found);
    } else if (event.kind === "failure") {
      this.#stop(SEARCH.hint);
      this.#events.report(asSecondary(event, SEARCH.aborted));
    }
  }
}
