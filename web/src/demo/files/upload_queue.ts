// Uploads from the user to the worker. Requests made while a file is being read are delayed until it is sent.
// Import options are stored per file and reused when the file is selected again.

import { FILES } from "../app/strings";
import { DEFAULT_OPTIONS } from "../worker/messages";
import type { FailureEvent, ImportOptions, Upload, WorkerRequest } from "../worker/messages";
import { isRecording } from "./dropped_files";

export interface UploadEvents {
  // Send the request to the workers.
  send(request: WorkerRequest): void;
  // A mesh is about to be sent; the worker may reject it.
  meshPending(request: Upload, file: File): void;
  // The file is too large to be sent.
  rejected(file: File): void;
  // The file could not be read; the current object stays.
  unreadable(): void;
  // The file was loaded with other options than before.
  optionsChanged(file: File, options: ImportOptions): void;
  report(failure: FailureEvent): void;
}

export class UploadQueue {
  readonly #events: UploadEvents;
  // File whose bytes are being read, and its options.
  #reading: { file: File; options: ImportOptions } | null = null;
  // Requests made since then.
  #delayed: WorkerRequest[] = [];
  readonly #options = new WeakMap<File, ImportOptions>();
  // Maximum size of a mesh file, from the worker.
  maxMeshBytes = Infinity;

  constructor(events: UploadEvents) {
    this.#events = events;
  }

  // Options with which a file was last loaded.
  options(file: File): ImportOptions | undefined {
    return this.#options.get(file);
  }

  // Options of a file whose bytes are being read.
  pendingOptions(file: File): ImportOptions | null {
    return this.#reading?.file === file ? this.#reading.options : null;
  }

  get isReading(): boolean {
    return this.#reading !== null;
  }

  // Restores options of an earlier visit, whose page may have had fewer options.
  restoreOptions(file: File, options: Partial<ImportOptions>): void {
    this.#options.set(file, { ...DEFAULT_OPTIONS, ...options });
  }

  // The worker has loaded a file with these options.
  loaded(file: File, options: ImportOptions): void {
    const previous = this.#options.get(file) ?? DEFAULT_OPTIONS;
    this.#options.set(file, options);
    if (JSON.stringify(previous) !== JSON.stringify(options)) this.#events.optionsChanged(file, options);
  }

  // Abandons the file that is being read.
  cancel(): void {
    this.#flush();
  }

  // Sends a request, after the file that is being read, to which it refers.
  send(request: WorkerRequest): void {
    if (this.#reading) this.#delayed.push(request);
    else this.#events.send(request);
  }

  #flush(): void {
    this.#reading = null;
    for (const request of this.#delayed.splice(0)) this.#events.send(request);
  }

  async start(file: File, options = DEFAULT_OPTIONS): Promise<void> {
    if (file.size > this.maxMeshBytes) {
      this.#events.rejected(file);
      const text = FILES.tooLarge(file.name, (file.size / 1e6).toFixed(0), this.maxMeshBytes / 1e6);
      this.#events.report({ kind: "failure", code: "mesh_too_large", ...text });
      return;
    }
    const own = { file, options };
    this.#reading = own;
    try {
      const bytes = await file.arrayBuffer();
      // Replaced by a newer upload, or cancelled.
      if (this.#reading !== own) return;
      const request = { kind: "upload", fileName: file.name, bytes, ...options } as const;
      // A recording refers to its own object.
      if (!isRecording(file.name)) this.#events.meshPending(request, file);
      this.#events.send(request);
      this.#flush();
    } catch (error) {
      if (this.#reading === own) this.#flush();
      this.#events.unreadable();
      this.#events.report({ kind: "failure", code: "file_unreadable", ...FILES.unreadable(file.name, String(error)) });
    }
  }
}
