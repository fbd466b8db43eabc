// Files on their way from a person to the worker, and what was said of each: counts when it is chosen again.

import { plays } from "./files";
import type { Failure, Told, ToWorker } from "./protocol";
import { FILES } from "./strings";

const NOTHING: Told = { unit: null, massKg: null, stands: null };

type Upload = Extract<ToWorker, { kind: "upload" }>;

export interface UploadEvents {
  // The file is to be read.
  read(message: Upload): void;
  // It is a mesh, which may be refused yet.
  asked(message: Upload, file: File): void;
  // It is not even read.
  refused(file: File): void;
  // Its bytes cannot be had; what stands there stays.
  unread(): void;
  // Something else was said of it than before.
  corrected(file: File, told: Told): void;
  tell(failure: Failure): void;
}

export class Uploads {
  readonly #events: UploadEvents;
  // The file whose bytes are awaited, and what is said of it.
  #awaited: { file: File; told: Told } | null = null;
  // What was asked for since it was chosen.
  #meanwhile: (() => void)[] = [];
  readonly #told = new WeakMap<File, Told>();
  // The longest file that the worker reads.
  mostBytes = Infinity;

  constructor(events: UploadEvents) {
    this.#events = events;
  }

  // What was said of a file so far.
  told(file: File): Told | undefined {
    return this.#told.get(file);
  }

  // What is said of a file while its bytes are awaited.
  awaited(file: File): Told | null {
    return this.#awaited?.file === file ? this.#awaited.told : null;
  }

  // Whether the bytes of a file are awaited.
  get isAwaiting(): boolean {
    return this.#awaited !== null;
  }

  // What was said of it on an earlier visit.
  remember(file: File, told: Told): void {
    this.#told.set(file, told);
  }

  // It stands there with what was said of it.
  loaded(file: File, told: Told): void {
    const before = this.#told.get(file) ?? NOTHING;
    this.#told.set(file, told);
    if (JSON.stringify(before) !== JSON.stringify(told)) this.#events.corrected(file, told);
  }

  // Something else is wanted now.
  forget(): void {
    this.#settle();
  }

  // What is asked for after a file is about that file, and comes to the worker after it.
  after(act: () => void): void {
    if (this.#awaited) this.#meanwhile.push(act);
    else act();
  }

  #settle(): void {
    this.#awaited = null;
    for (const act of this.#meanwhile.splice(0)) act();
  }

  async begin(file: File, told = NOTHING): Promise<void> {
    if (file.size > this.mostBytes) {
      this.#events.refused(file);
      const cause = FILES.tooLarge(file.name, (file.size / 1e6).toFixed(0), this.mostBytes / 1e6);
      this.#events.tell({ kind: "failure", code: "mesh_too_large", ...cause });
      return;
    }
    const own = { file, told };
    this.#awaited = own;
    try {
      const bytes = await file.arrayBuffer();
      // Another one was chosen meanwhile, or something else is said of it.
      if (this.#awaited !== own) return;
      const message = { kind: "upload", fileName: file.name, bytes, ...told } as const;
      // What plays brings its own object.
      if (!plays(file.name)) this.#events.asked(message, file);
      this.#events.read(message);
      this.#settle();
    } catch (error) {
      if (this.#awaited === own) this.#settle();
      this.#events.unread();
      this.#events.tell({ kind: "failure", code: "file_unreadable", ...FILES.unreadable(file.name, String(error)) });
    }
  }
}
