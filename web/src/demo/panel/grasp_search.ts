// Grasp search without a policy: tries grasps in several workers, plays the best one and any other one.

import { element, h } from "../../common/dom";
import { duration } from "../../common/numbers";
import type { EventBus } from "../app/event_bus";
import { SEARCH } from "../app/strings";
import type { FailureEvent, WorkerRequest } from "../worker/messages";
import type { GraspsFound, SearchBatch } from "../worker/protocol";
import { SearchWorkers } from "../worker/search_workers";
import { asSecondary } from "../worker/worker_client";

// Grasps that get a button of their own.
const MAX_BUTTONS = 12;

export interface GraspSearchEvents {
  send(request: WorkerRequest): void;
  hasObject(): boolean;
  seed(): number;
  // Starts an attempt with the first reachable grasp.
  play(grasps: Uint8Array[], objectHash: string): void;
  report(failure: FailureEvent): void;
}

// A search while it runs.
interface Running {
  isLong: boolean;
  seed: number;
  startMs: number;
  workers: SearchWorkers | null;
}

export class GraspSearchPanel {
  readonly #events: GraspSearchEvents;
  readonly #button = element("search", HTMLButtonElement);
  readonly #longer = element("search-longer", HTMLButtonElement);
  readonly #bar = element("search-bar", HTMLProgressElement);
  readonly #status = element("search-status", HTMLElement);
  readonly #grasps = element("search-grasps", HTMLElement);
  #running: Running | null = null;

  constructor(bus: EventBus, events: GraspSearchEvents) {
    this.#events = events;
    bus.on("objectChanged", () => this.#clear());
    bus.on("searchBatch", (batch) => this.#onBatch(batch));
    bus.on("graspsFound", (found) => this.#onFound(found));
    bus.on("stopped", () => this.#stop(SEARCH.stopped));
    this.#button.addEventListener("click", () => (this.#running ? this.#cancel() : this.#start(false)));
    this.#longer.addEventListener("click", () => this.#start(true));
    this.#clear();
  }

  // Discards the grasps of the previous object.
  #clear(): void {
    this.#button.disabled = !this.#events.hasObject();
    this.#longer.hidden = true;
    this.#grasps.replaceChildren();
    this.#stop(SEARCH.hint);
  }

  #start(isLong: boolean): void {
    this.#running = { isLong, seed: this.#events.seed(), startMs: performance.now(), workers: null };
    this.#events.send({ kind: "searchGrasps", isLong });
    this.#button.textContent = SEARCH.stop;
    this.#longer.hidden = true;
    this.#grasps.replaceChildren();
    this.#bar.hidden = false;
    this.#bar.removeAttribute("value");
    this.#status.textContent = SEARCH.starting;
  }

  #cancel(): void {
    this.#events.send({ kind: "cancelSearch" });
    this.#longer.hidden = false;
    this.#stop(SEARCH.stopped);
  }

  #stop(status: string): void {
    this.#running?.workers?.terminate();
    this.#running = null;
    this.#bar.hidden = true;
    this.#button.textContent = SEARCH.start;
    this.#status.textContent = status;
  }

  #onBatch(batch: SearchBatch): void {
    const running = this.#running;
    if (!running) return;
    if (batch.object) running.workers ??= this.#startWorkers(running, batch.object);
    running.workers?.run(batch);
    this.#bar.value = batch.fraction;
    const seconds = (performance.now() - running.startMs) / 1000;
    const left = (seconds * (1 - batch.fraction)) / batch.fraction;
    const { tried, grasps } = batch.found;
    this.#status.textContent = SEARCH.progress(tried, grasps.length, tried / seconds, duration(left));
    this.#showGrasps(batch.found);
  }

  #startWorkers({ seed, isLong }: Running, object: Uint8Array): SearchWorkers {
    return new SearchWorkers(object, seed, isLong, {
      complete: (results) => this.#events.send({ kind: "completeSearchBatch", results }),
      report: (failure) => {
        this.#stop(SEARCH.hint);
        this.#events.report(asSecondary(failure, SEARCH.aborted));
      },
    });
  }

  #onFound(found: GraspsFound): void {
    if (!this.#running) return;
    const { isLong } = this.#running;
    this.#stop(SEARCH.found(found.tried, found.grasps.length, isLong));
    this.#longer.hidden = isLong;
    this.#showGrasps(found);
    if (found.grasps.length > 0) this.#events.play(found.grasps, found.objectHash);
  }

  // A button for each grasp; a batch only adds grasps.
  #showGrasps({ grasps, objectHash }: GraspsFound): void {
    const play = (grasp: Uint8Array) => () => this.#events.play([grasp], objectHash);
    const button = (grasp: Uint8Array, i: number) =>
      h("button", { type: "button", class: "quiet", "aria-label": SEARCH.play(i + 1), click: play(grasp) }, String(i + 1));
    this.#grasps.replaceChildren(...grasps.slice(0, MAX_BUTTONS).map(button));
  }
}
