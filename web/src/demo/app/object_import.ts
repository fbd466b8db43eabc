// Import of objects: the list, the queue of uploads, and the import options of a mesh file.

import { UploadQueue } from "../files/upload_queue";
import type { ErrorCards } from "../panel/error_cards";
import { ObjectInfoPanel } from "../panel/object_info";
import { ObjectPicker } from "../panel/object_picker";
import { sizeForm } from "../panel/size_form";
import { MESH_READER_FAILED } from "../worker/messages";
import type { FailureEvent, ImportOptions, WorkerRequest } from "../worker/messages";
import type { Model, ObjectLoaded, Ready } from "../worker/protocol";
import { isFatal } from "../worker/worker_client";
import type { EventBus } from "./event_bus";
import type { SessionState } from "./session_state";
import { FILES } from "./strings";

// Code of the failure that asks for the size of a mesh.
export const SIZE_REQUIRED = "size_required";

export interface ObjectImportEvents {
  // Load a built-in object.
  load(object: string): void;
  // Send the request to the workers.
  send(request: WorkerRequest): void;
  // Import options of a file: those of the share link, or the earlier ones.
  optionsFor(file: File, earlier?: ImportOptions): ImportOptions | undefined;
}

export class ObjectImport {
  readonly #state: SessionState;
  readonly #events: ObjectImportEvents;
  readonly #picker: ObjectPicker;
  readonly #uploads: UploadQueue;
  readonly #errors: ErrorCards;
  readonly #info: ObjectInfoPanel;

  constructor(bus: EventBus, state: SessionState, errors: ErrorCards, events: ObjectImportEvents) {
    [this.#state, this.#events, this.#errors] = [state, events, errors];
    this.#picker = new ObjectPicker({
      load: (object) => {
        this.#uploads.cancel();
        events.load(object);
      },
      upload: (file) => {
        bus.emit({ kind: "fileSelected" });
        void this.start(file);
      },
      optionsRestored: (file, options) => this.#uploads.restoreOptions(file, options),
      unreadable: (why) => errors.report("files_unreadable", FILES.unreadableArchive(why)),
      skipped: (max) => errors.report("files_skipped", FILES.skipped(max)),
      notStored: ({ name }) => errors.report("mesh_not_stored", FILES.notStored(name)),
    });
    this.#uploads = new UploadQueue({
      send: (request) => events.send(request),
      meshPending: (request, file) => state.addPending(request, file),
      rejected: (file) => this.#picker.reject(file),
      unreadable: () => this.#picker.restoreSelection(),
      optionsChanged: (file, options) => this.#picker.storeOptions(file, options),
      report: (failure) => errors.show(failure),
    });
    bus.on("ready", (ready) => this.#showReady(ready));
    bus.on("object", (object) => this.#showObject(object));
    bus.on("failure", (failure) => this.#onFailure(failure));
    this.#info = new ObjectInfoPanel(bus, (change) => this.#changeOptions(change));
  }

  #showReady({ objects, maxMeshBytes }: Ready): void {
    this.#picker.show(objects);
    this.#uploads.maxMeshBytes = maxMeshBytes;
  }

  #showObject(object: ObjectLoaded): void {
    const { file, options } = this.#state;
    this.#picker.select(object, file);
    if (file && options) {
      this.#uploads.loaded(file, options);
      this.#info.showOptions(options);
    }
    if (file) this.#errors.dismiss(SIZE_REQUIRED);
  }

  // Sends a request, after the file that is being read.
  send(request: WorkerRequest): void {
    this.#uploads.send(request);
  }

  // Imports a mesh, or replays a recording.
  start(file: File): Promise<void> {
    return this.#uploads.start(file, this.#events.optionsFor(file, this.#uploads.options(file)));
  }

  add(file: File): void {
    this.#picker.add(file);
  }

  addIfNew(file: File): void {
    this.#picker.addIfNew(file);
  }

  // Imports a mesh again whose orientation was chosen before a policy was loaded. A pending import replaces it
  // anyway.
  reorient(model: Model): void {
    const { file, options, orientationReason, isImporting } = this.#state;
    const isIdle = !this.#uploads.isReading && !isImporting;
    if (model.id !== null && orientationReason === "unstable" && file && options && isIdle) void this.#uploads.start(file, options);
  }

  // Removes the files whose import is stopped.
  abandonPending(): void {
    while (this.#state.isImporting) {
      const file = this.#state.rejected();
      if (file) this.#picker.abandonUpload(file);
    }
  }

  // A new worker starts.
  restart(): void {
    this.#uploads.cancel();
    this.#picker.enable();
  }

  // The file stays in the list; the current object stays until the size is given.
  #askSize(failure: FailureEvent): void {
    const { file, options } = this.#state.refused();
    if (!file) {
      this.#errors.show(failure);
      return;
    }
    this.#picker.restoreSelection();
    const use = (sizeM: number) => {
      this.#errors.dismiss(SIZE_REQUIRED);
      void this.#uploads.start(file, { ...options, unit: null, scale: null, sizeM });
    };
    this.#errors.show(failure, sizeForm(use));
  }

  #changeOptions(change: Partial<ImportOptions>): void {
    const { file, newestOptions, orientation: current } = this.#state;
    if (!file || !newestOptions) return;
    const options = this.#uploads.pendingOptions(file) ?? newestOptions;
    // A new size or up axis can change the stable poses, so an automatic orientation is chosen again; otherwise the
    // current one is kept.
    const isNewShape = change.unit !== undefined || change.sizeM !== undefined || change.up !== undefined;
    const orientation = isNewShape ? options.orientation : (options.orientation ?? current);
    void this.#uploads.start(file, { ...options, orientation, ...change });
  }

  #onFailure(failure: FailureEvent): void {
    if (isFatal(failure)) {
      // A mesh that crashed this worker would crash the next one too.
      this.abandonPending();
      this.#picker.disable();
    }
    if (failure.code === SIZE_REQUIRED) this.#askSize(failure);
    if (failure.code === MESH_READER_FAILED) {
      this.#state.refused();
      this.#picker.restoreSelection();
    }
    if (failure.code !== "invalid_mesh") return;
    // Null: the file is the current object, which stays in the list.
    const file = this.#state.rejected();
    if (file) this.#picker.reject(file);
  }
}
