// How things stand, as another worker is told: the object, once a worker has it, where it stands, how fast time goes.

import type { Because, Frame, ObjectLoaded, Stands, Told, ToWorker } from "./protocol";

type Upload = Extract<ToWorker, { kind: "upload" }>;

// A message that puts an object there, and its file if it has one.
type Standing = { message: Upload; file: File } | { message: Extract<ToWorker, { kind: "load" }>; file: null };

export class Situation {
  #object: Standing | null = null;
  // On which side it stands, and why, if it is a mesh.
  #stands: Stands | null = null;
  #because: Because | null = null;
  // Meshes that are being read, in their order.
  #coming: { message: Upload; file: File }[] = [];
  #pose: ToWorker | null = null;
  #speed: ToWorker | null = null;
  #isNew = false;

  // A worker begins, with an object of its own.
  ready(): void {
    this.#isNew = true;
  }

  // This mesh is to be read, and may be refused yet.
  ask(message: Upload, file: File): void {
    this.#coming.push({ message, file });
  }

  // Whether that is news: what stands in a new worker by itself gives way to what stood there before.
  loaded({ name, label, report }: ObjectLoaded): boolean {
    const isByItself = this.#isNew;
    this.#isNew = false;
    if (isByItself && this.#object) return false;
    if (name !== null) this.#object = { message: { kind: "load", object: name }, file: null };
    // What plays may be about the file that stands there anyway.
    else if (this.#coming[0]?.file.name === label) this.#object = this.#coming.shift()!;
    [this.#stands, this.#because] = [report.stands, report.because];
    return true;
  }

  // A mesh cannot be read; says of which file nothing is left then.
  refused(): File | null {
    const file = this.#coming.shift()?.file;
    return file && file !== this.file ? file : null;
  }

  // Whether a mesh is being read.
  get isReading(): boolean {
    return this.#coming.length > 0;
  }

  // The meshes that are being read.
  coming(): ToWorker[] {
    return this.#coming.map(({ message }) => message);
  }

  // Another worker is begun: what the last one was reading is not tried again.
  restart(): ToWorker[] {
    this.#coming = [];
    return this.now();
  }

  show({ pose, drawn, factor }: Frame): void {
    this.#pose = drawn === null ? { kind: "place", pose } : { kind: "randomPose", seed: drawn };
    this.#speed = { kind: "speed", factor };
  }

  // The file that stands there, if it is one.
  get file(): File | null {
    return this.#object?.file ?? null;
  }

  // What was said of it.
  get told(): Told | null {
    return this.#object?.file ? told(this.#object.message) : null;
  }

  // The same with what was said since, which may be being read.
  get lastTold(): Told | null {
    const last = this.#coming.findLast(({ file }) => file === this.file);
    return last ? told(last.message) : this.told;
  }

  // Why it stands as it does, if it is a mesh.
  get because(): Because | null {
    return this.file && this.#because;
  }

  // How it stands, said or guessed: in another worker another policy, or none, might guess otherwise.
  get stands(): Stands | null {
    return this.file && this.#stands;
  }

  now(): ToWorker[] {
    return [this.object(), this.#pose, this.#speed].filter((message) => message != null);
  }

  // The message that puts the object there as it stands.
  object(): ToWorker | null {
    const message = this.#object?.message ?? null;
    return message?.kind === "upload" ? { ...message, stands: message.stands ?? this.#stands } : message;
  }
}

function told({ unit, massKg, stands }: Upload): Told {
  return { unit, massKg, stands };
}
