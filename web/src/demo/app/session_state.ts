// Session state to replay into a new worker: object, pose, speed.

import { DEFAULT_OPTIONS } from "../worker/messages";
import type { ImportOptions, Upload, WorkerRequest } from "../worker/messages";
import type { Frame, ObjectLoaded, Orientation, OrientationReason } from "../worker/protocol";
import type { EventBus } from "./event_bus";

// Request that loaded the current object, and its file for an upload.
type CurrentObject =
  | { request: Upload; file: File }
  | { request: Extract<WorkerRequest, { kind: "loadObject" }>; file: null };

export class SessionState {
  #object: CurrentObject | null = null;
  // Orientation of a mesh, and its reason.
  #orientation: Orientation | null = null;
  #orientationReason: OrientationReason | null = null;
  // Meshes that the worker is importing, in order.
  #pending: { request: Upload; file: File }[] = [];
  #pose: WorkerRequest | null = null;
  #speed: WorkerRequest | null = null;
  #isNewWorker = false;

  constructor(bus: EventBus) {
    // A new worker loads a default object.
    bus.on("ready", () => (this.#isNewWorker = true));
    bus.on("frame", (frame) => this.#showFrame(frame));
  }

  // A mesh was sent to the worker, which may reject it.
  addPending(request: Upload, file: File): void {
    this.#pending.push({ request, file });
  }

  // Returns false for the default object of a new worker that is about to be replaced by the current object.
  objectLoaded({ name, label, info }: ObjectLoaded): boolean {
    const isDefault = this.#isNewWorker;
    this.#isNewWorker = false;
    if (isDefault && this.#object) return false;
    if (name !== null) this.#object = { request: { kind: "loadObject", object: name }, file: null };
    // A recording of the current file reports that object again; then nothing is pending.
    else if (this.#pending[0]?.file.name === label) this.#object = this.#pending.shift()!;
    [this.#orientation, this.#orientationReason] = [info.orientation, info.orientationReason];
    return true;
  }

  // The worker rejected the first pending mesh. Returns its file, or null if that file is the current object.
  rejected(): File | null {
    const file = this.#pending.shift()?.file;
    return file && file !== this.file ? file : null;
  }

  // The worker needs options for the first pending mesh. Returns its file, null if there is none, and its options.
  refused(): { file: File | null; options: ImportOptions } {
    const first = this.#pending.shift();
    return { file: first?.file ?? null, options: first ? optionsOf(first.request) : DEFAULT_OPTIONS };
  }

  get isImporting(): boolean {
    return this.#pending.length > 0;
  }

  pending(): WorkerRequest[] {
    return this.#pending.map(({ request }) => request);
  }

  // Requests for a new worker. Meshes that the previous worker was importing are dropped.
  restart(): WorkerRequest[] {
    this.#pending = [];
    return this.requests();
  }

  #showFrame({ pose, poseSeed, speed }: Frame): void {
    this.#pose = poseSeed === null ? { kind: "place", pose } : { kind: "placeBySeed", seed: poseSeed };
    this.#speed = { kind: "speed", factor: speed };
  }

  // File of the current object, if it is an upload.
  get file(): File | null {
    return this.#object?.file ?? null;
  }

  // Import options of the current file.
  get options(): ImportOptions | null {
    return this.#object?.file ? optionsOf(this.#object.request) : null;
  }

  // Newest import options of the current file, including a pending import.
  get newestOptions(): ImportOptions | null {
    const last = this.#pending.findLast(({ file }) => file === this.file);
    return last ? optionsOf(last.request) : this.options;
  }

  get orientationReason(): OrientationReason | null {
    return this.file && this.#orientationReason;
  }

  // Orientation of the current file, given or chosen. A worker with another policy might choose differently.
  get orientation(): Orientation | null {
    return this.file && this.#orientation;
  }

  requests(): WorkerRequest[] {
    return [this.objectRequest(), this.#pose, this.#speed].filter((request) => request != null);
  }

  // Request that loads the current object in its current orientation.
  objectRequest(): WorkerRequest | null {
    const request = this.#object?.request ?? null;
    return request?.kind === "upload" ? { ...request, orientation: request.orientation ?? this.#orientation } : request;
  }
}

function optionsOf({ unit, sizeM, scale, up, massKg, orientation }: Upload): ImportOptions {
  return { unit, sizeM, scale, up, massKg, orientation };
}
