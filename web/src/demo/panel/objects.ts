// Choosing an object: from the list, by button, dropped anywhere on the page, or pasted. What was brought stays in the list.

import { element, h } from "../../common/dom";
import { dropped, plays, readable } from "../files";
import type { ObjectLoaded, Ready, Shape, Told } from "../protocol";
import { Shelf } from "../shelf";
import { MOST } from "../zip";
import { thumbnail } from "./thumbnail";

export interface ObjectEvents {
  load(name: string): void;
  upload(file: File): void;
  // A file was brought on an earlier visit, and this was said of it.
  corrected(file: File, told: Told): void;
  // Nothing could be read, and why.
  refused(cause: string): void;
  // More were brought than so many, which were taken.
  cut(most: number): void;
  // The browser has no room for it.
  unkept(file: File): void;
}

// A file in the list.
interface Brought {
  file: File;
  choice: HTMLLabelElement;
  // Whether the browser's store has it, too, or is to have it once it has been read.
  isKept: boolean | "later";
  // Whether it has been read, now or on an earlier visit.
  wasRead: boolean;
  // The one of its name whose place it takes once it has been read.
  before: Brought | null;
}

export class ObjectPicker {
  readonly #events: ObjectEvents;
  readonly #list = element("objects", HTMLFieldSetElement);
  readonly #button = element("upload", HTMLButtonElement);
  readonly #folderButton = element("upload-folder", HTMLButtonElement);
  readonly #remove = element("remove", HTMLButtonElement);
  readonly #shelf = new Shelf();
  // By name: the last of a name counts.
  readonly #files = new Map<string, Brought>();
  // What is drawn before a name.
  readonly #shapes = new WeakMap<HTMLElement, Shape>();
  // The name of a built-in object, or the file.
  #selected: string | File | null = null;
  #first = "";

  constructor(events: ObjectEvents) {
    this.#events = events;
    this.#chooseBy(this.#button, element("file", HTMLInputElement));
    // Where no folder can be chosen, as on some phones, it can be dropped.
    const canChoose = "webkitdirectory" in HTMLInputElement.prototype;
    this.#folderButton.hidden = !canChoose;
    element("folder-as-words", HTMLElement).hidden = canChoose;
    this.#chooseBy(this.#folderButton, element("folder", HTMLInputElement));
    addEventListener("paste", ({ clipboardData }) => {
      const files = [...(clipboardData?.files ?? [])];
      if (files.length > 0) void this.#take(files);
    });
    this.#remove.addEventListener("click", () => {
      if (this.#selected instanceof File) this.#forget(this.#selected.name);
      this.#events.load(this.#first);
    });
    this.#acceptDrops();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      for (const choice of this.#list.querySelectorAll("label")) {
        const shape = this.#shapes.get(choice);
        if (shape) this.#picture(choice, shape);
      }
    });
    void this.#restore();
  }

  show(objects: Ready["objects"]): void {
    this.#list.querySelectorAll("label.built-in").forEach((label) => label.remove());
    const first = this.#list.querySelector("label") ?? this.#button;
    this.#first = objects[0]?.name ?? "";
    for (const { name, label, shape } of objects) {
      const choice = this.#choice(name, label, () => this.#events.load(name));
      this.#picture(choice, shape);
      choice.classList.add("built-in");
      first.before(choice);
    }
    this.#button.disabled = false;
    this.#folderButton.disabled = false;
  }

  #chooseBy(button: HTMLButtonElement, input: HTMLInputElement): void {
    button.addEventListener("click", () => input.click());
    input.addEventListener("change", () => {
      void this.#take([...(input.files ?? [])]);
      // So that the same file can be chosen again.
      input.value = "";
    });
  }

  // Marks a built-in object, or else the file, which is drawn now that its shape is known.
  select({ name, label, shape }: Pick<ObjectLoaded, "name" | "label" | "shape">, stands: File | null): void {
    // What plays may bring another object than the file.
    const file = stands?.name === label ? stands : null;
    const brought = file && this.#find(file);
    if (brought) {
      this.#picture(brought.choice, shape);
      brought.wasRead = true;
      if (brought.isKept === "later") {
        brought.isKept = true;
        void this.#keep(brought.file);
      }
      brought.before = null;
    }
    this.#mark(name ?? file);
  }

  // What was chosen did not come: what stands there is marked again.
  stay(): void {
    this.#mark(this.#selected);
  }

  #mark(selected: string | File | null): void {
    this.#selected = selected;
    const file = selected instanceof File ? this.#find(selected) : null;
    for (const input of this.#list.querySelectorAll("input")) input.checked = input.value === selected;
    if (file) file.choice.querySelector("input")!.checked = true;
    this.#remove.hidden = !file;
  }

  #choice(value: string, label: string, chosen: () => void): HTMLLabelElement {
    const change = () => {
      // What is marked is not there yet, and what is there is not marked.
      this.#remove.hidden = true;
      chosen();
    };
    return h("label", { title: label }, h("input", { type: "radio", name: "object", value, change }), h("span", {}, label));
  }

  // What was said of a file is kept with it.
  correct(file: File, told: Told): void {
    if (this.#find(file)?.isKept === true) void this.#keep(file, told);
  }

  async #keep(file: File, told?: Told): Promise<void> {
    if (!(await this.#shelf.keep(file, told))) this.#events.unkept(file);
  }

  // Puts a file into the list, in the place of one of its name, which comes back if this one cannot be read.
  add(file: File, isKept: boolean | "later" = false, wasRead = false): void {
    const before = this.#files.get(file.name) ?? null;
    before?.choice.remove();
    const choice = this.#choice(`file:${file.name}`, file.name, () => this.#events.upload(file));
    this.#put({ file, choice, isKept, wasRead, before });
  }

  // The same, unless there is one of its name.
  offer(file: File): void {
    if (!this.#files.has(file.name)) this.add(file);
  }

  #put(brought: Brought): void {
    this.#files.set(brought.file.name, brought);
    this.#button.before(brought.choice);
  }

  // A file and those of its name that it is to take the place of, the last one first.
  #all(fileName: string): Brought[] {
    const all = [];
    for (let one = this.#files.get(fileName) ?? null; one; one = one.before) all.push(one);
    return all;
  }

  #find(file: File): Brought | null {
    return this.#all(file.name).find((one) => one.file === file) ?? null;
  }

  // Nobody who could read is there.
  disable(): void {
    this.#list.disabled = true;
  }

  enable(): void {
    this.#list.disabled = false;
  }

  // Takes a file that is of no use from the list; what stood there still does, and so does one of its name before it.
  refuse(file: File): void {
    const refused = this.#find(file);
    if (refused) {
      const after = this.#all(file.name).find(({ before }) => before === refused);
      if (after) after.before = refused.before;
      else {
        refused.choice.remove();
        this.#files.delete(file.name);
        if (refused.before) this.#put(refused.before);
      }
      if (refused.isKept === true) void this.#shelf.forget(file.name);
    }
    this.#mark(this.#selected);
  }

  // The same with one that is no longer waited for, but for what has been of use before.
  giveUp(file: File): void {
    if (!this.#find(file)?.wasRead) this.refuse(file);
    this.#mark(this.#selected);
  }

  // Nothing of this name is there any more.
  #forget(fileName: string): void {
    const all = this.#all(fileName);
    for (const { choice } of all) choice.remove();
    this.#files.delete(fileName);
    if (all.some(({ isKept }) => isKept === true)) void this.#shelf.forget(fileName);
  }

  // What was brought on an earlier visit, but for what has been brought again since.
  async #restore(): Promise<void> {
    for (const { file, told } of await this.#shelf.files()) {
      if (this.#files.has(file.name)) continue;
      this.add(file, true, true);
      if (told) this.#events.corrected(file, told);
    }
  }

  // The first mesh is shown, the others stand in the list; without one the first file is played.
  async #take(brought: Iterable<File> | Promise<File[]>): Promise<void> {
    if (this.#list.disabled) return;
    let files: File[];
    try {
      files = await readable(await brought);
    } catch (error) {
      this.#events.refused(error instanceof Error ? error.message : String(error));
      return;
    }
    if (files.length > MOST) this.#events.cut(MOST);
    files = files.slice(0, MOST);
    // What plays brings its own object.
    for (const file of files) {
      if (plays(file.name)) continue;
      const waits = this.#all(file.name).some(({ isKept }) => isKept === true);
      this.add(file, waits ? "later" : true);
      if (!waits) void this.#keep(file);
    }
    const first = files.find(({ name }) => !plays(name)) ?? files[0];
    if (first) this.#events.upload(first);
  }

  // Puts a picture of a shape before a choice's name.
  #picture(choice: HTMLElement, shape: Shape): void {
    this.#shapes.set(choice, shape);
    choice.querySelector("canvas")?.remove();
    const color = getComputedStyle(document.documentElement).getPropertyValue("--accent").trim();
    choice.querySelector("span")?.before(thumbnail(shape, color));
  }

  #acceptDrops(): void {
    const overlay = element("drop", HTMLElement);
    const hasFile = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    // Moving between elements leaves one and enters the next.
    let depth = 0;
    const set = (value: number) => {
      depth = Math.max(0, value);
      overlay.hidden = depth === 0;
    };
    addEventListener("dragenter", (event) => hasFile(event) && set(depth + 1));
    addEventListener("dragleave", (event) => hasFile(event) && set(depth - 1));
    addEventListener("dragover", (event) => event.preventDefault());
    addEventListener("drop", (event) => {
      event.preventDefault();
      set(0);
      void this.#take(dropped(event.dataTransfer));
    });
  }
}

