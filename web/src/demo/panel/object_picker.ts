// Object selection: built-in objects and the user's meshes, added by button, drop or paste and stored until
// removed.

import { element, h } from "../../common/dom";
import { droppedFiles, isRecording, readableFiles } from "../files/dropped_files";
import { MAX_FILES, MeshStore } from "../files/mesh_store";
import type { ImportOptions } from "../worker/messages";
import type { ObjectLoaded, Ready, Shape } from "../worker/protocol";
import { thumbnail } from "./thumbnail";

export interface ObjectEvents {
  load(name: string): void;
  upload(file: File): void;
  // Import options of a file from an earlier visit.
  optionsRestored(file: File, options: ImportOptions): void;
  // No file could be read.
  unreadable(why: string): void;
  // Only the first `max` files were added.
  skipped(max: number): void;
  // The browser could not store the file.
  notStored(file: File): void;
}

// Characters at the end of a name that are always shown: files of a series differ there.
const NAME_END = 8;

// The user's mesh in the list.
interface MeshEntry {
  file: File;
  item: HTMLLabelElement;
  // Whether the file is in the mesh store; "afterImport": it is stored once the worker has imported it.
  isStored: boolean | "afterImport";
  // Whether the worker has imported it, now or on an earlier visit.
  wasImported: boolean;
  // Entry of the same name that this one replaces once it is imported.
  previous: MeshEntry | null;
}

export class ObjectPicker {
  readonly #events: ObjectEvents;
  readonly #list = element("objects", HTMLFieldSetElement);
  readonly #button = element("upload", HTMLButtonElement);
  readonly #folderButton = element("upload-folder", HTMLButtonElement);
  readonly #remove = element("remove", HTMLButtonElement);
  readonly #store = new MeshStore();
  // Newest entry of each file name.
  readonly #entries = new Map<string, MeshEntry>();
  // Shapes of the thumbnails.
  readonly #shapes = new WeakMap<HTMLElement, Shape>();
  // Name of a built-in object, or the file.
  #selected: string | File | null = null;
  #firstName = "";

  constructor(events: ObjectEvents) {
    this.#events = events;
    this.#openDialogOn(this.#button, element("file", HTMLInputElement));
    // Some phones have no folder dialog; folders can still be dropped.
    const canSelectFolder = "webkitdirectory" in HTMLInputElement.prototype;
    this.#folderButton.hidden = !canSelectFolder;
    element("folder-text", HTMLElement).hidden = canSelectFolder;
    this.#openDialogOn(this.#folderButton, element("folder", HTMLInputElement));
    addEventListener("paste", ({ clipboardData }) => {
      const files = [...(clipboardData?.files ?? [])];
      if (files.length > 0) void this.#addFiles(files);
    });
    this.#remove.addEventListener("click", () => {
      if (this.#selected instanceof File) this.#delete(this.#selected.name);
      this.#events.load(this.#firstName);
    });
    this.#acceptDrops();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      for (const item of this.#list.querySelectorAll("label")) {
        const shape = this.#shapes.get(item);
        if (shape) this.#showThumbnail(item, shape);
      }
    });
    void this.#restoreStored();
  }

  show(objects: Ready["objects"]): void {
    this.#list.querySelectorAll("label.built-in").forEach((label) => label.remove());
    const first = this.#list.querySelector("label") ?? this.#button;
    this.#firstName = objects[0]?.name ?? "";
    for (const { name, label, shape } of objects) {
      const item = this.#makeItem(name, label, () => this.#events.load(name));
      this.#showThumbnail(item, shape);
      item.classList.add("built-in");
      first.before(item);
    }
    this.#button.disabled = false;
    this.#folderButton.disabled = false;
  }

  #openDialogOn(button: HTMLButtonElement, input: HTMLInputElement): void {
    button.addEventListener("click", () => input.click());
    input.addEventListener("change", () => {
      void this.#addFiles([...(input.files ?? [])]);
      // Allows selecting the same file again.
      input.value = "";
    });
  }

  // Marks the loaded object, and adds the thumbnail of a mesh file. `current`: file of the session, if any.
  select({ name, label, shape }: Pick<ObjectLoaded, "name" | "label" | "shape">, current: File | null): void {
    // A recording can load another object than the file.
    const file = current?.name === label ? current : null;
    const entry = file && this.#find(file);
    if (entry) {
      this.#showThumbnail(entry.item, shape);
      entry.wasImported = true;
      if (entry.isStored === "afterImport") {
        entry.isStored = true;
        void this.#put(entry.file);
      }
      entry.previous = null;
    }
    this.#mark(name ?? file);
  }

  // Marks the current object again after a failed upload.
  restoreSelection(): void {
    this.#mark(this.#selected);
  }

  #mark(selected: string | File | null): void {
    this.#selected = selected;
    const entry = selected instanceof File ? this.#find(selected) : null;
    for (const input of this.#list.querySelectorAll("input")) input.checked = input.value === selected;
    if (entry) entry.item.querySelector("input")!.checked = true;
    this.#remove.hidden = !entry;
  }

  #makeItem(value: string, label: string, onSelect: () => void): HTMLLabelElement {
    const change = () => {
      // Until the object is loaded, the checked item is not the current object.
      this.#remove.hidden = true;
      onSelect();
    };
    const [start, end] = [label.slice(0, -NAME_END), label.slice(-NAME_END)];
    const name = h("span", { class: "name" }, h("span", {}, start), end);
    return h("label", { title: label }, h("input", { type: "radio", name: "object", value, change }), name);
  }

  // Stores the import options with a file.
  storeOptions(file: File, options: ImportOptions): void {
    if (this.#find(file)?.isStored === true) void this.#put(file, options);
  }

  async #put(file: File, options?: ImportOptions): Promise<void> {
    if (!(await this.#store.put(file, options))) this.#events.notStored(file);
  }

  // Adds a file. It replaces an entry of the same name, which is restored if the new file cannot be imported.
  add(file: File, isStored: boolean | "afterImport" = false, wasImported = false): void {
    const previous = this.#entries.get(file.name) ?? null;
    previous?.item.remove();
    const item = this.#makeItem(`file:${file.name}`, file.name, () => this.#events.upload(file));
    this.#insert({ file, item, isStored, wasImported, previous });
  }

  // Adds a file unless its name is in the list.
  addIfNew(file: File): void {
    if (!this.#entries.has(file.name)) this.add(file);
  }

  #insert(entry: MeshEntry): void {
    this.#entries.set(entry.file.name, entry);
    this.#button.before(entry.item);
  }

  // Entries of a file name, newest first.
  #versions(fileName: string): MeshEntry[] {
    const versions = [];
    for (let entry = this.#entries.get(fileName) ?? null; entry; entry = entry.previous) versions.push(entry);
    return versions;
  }

  #find(file: File): MeshEntry | null {
    return this.#versions(file.name).find((entry) => entry.file === file) ?? null;
  }

  // Disabled without a worker that could import.
  disable(): void {
    this.#list.disabled = true;
  }

  enable(): void {
    this.#list.disabled = false;
  }

  // Removes a file that cannot be imported and restores the entry that it replaced. The current object stays.
  reject(file: File): void {
    const rejected = this.#find(file);
    if (rejected) {
      const newer = this.#versions(file.name).find(({ previous }) => previous === rejected);
      if (newer) newer.previous = rejected.previous;
      else {
        rejected.item.remove();
        this.#entries.delete(file.name);
        if (rejected.previous) this.#insert(rejected.previous);
      }
      if (rejected.isStored === true) void this.#store.delete(file.name);
    }
    this.#mark(this.#selected);
  }

  // Rejects a file whose import was stopped, unless it has been imported before.
  abandonUpload(file: File): void {
    if (!this.#find(file)?.wasImported) this.reject(file);
    this.#mark(this.#selected);
  }

  // Removes all entries of a file name.
  #delete(fileName: string): void {
    const versions = this.#versions(fileName);
    for (const { item } of versions) item.remove();
    this.#entries.delete(fileName);
    if (versions.some(({ isStored }) => isStored === true)) void this.#store.delete(fileName);
  }

  // Adds the stored files of earlier visits, except those that were added again meanwhile.
  async #restoreStored(): Promise<void> {
    for (const { file, options } of await this.#store.files()) {
      if (this.#entries.has(file.name)) continue;
      this.add(file, true, true);
      if (options) this.#events.optionsRestored(file, options);
    }
  }

  // Adds the meshes to the list and loads the first one. Without a mesh, replays the first recording.
  async #addFiles(selected: Iterable<File> | Promise<File[]>): Promise<void> {
    if (this.#list.disabled) return;
    let files: File[];
    try {
      files = await readableFiles(await selected);
    } catch (error) {
      this.#events.unreadable(error instanceof Error ? error.message : String(error));
      return;
    }
    if (files.length > MAX_FILES) this.#events.skipped(MAX_FILES);
    files = files.slice(0, MAX_FILES);
    for (const file of files) {
      if (isRecording(file.name)) continue;
      // A stored version of the same name is overwritten only after a successful import.
      const replacesStored = this.#versions(file.name).some(({ isStored }) => isStored === true);
      this.add(file, replacesStored ? "afterImport" : true);
      if (!replacesStored) void this.#put(file);
    }
    const first = files.find(({ name }) => !isRecording(name)) ?? files[0];
    if (first) this.#events.upload(first);
  }

  #showThumbnail(item: HTMLElement, shape: Shape): void {
    this.#shapes.set(item, shape);
    item.querySelector("canvas")?.remove();
    const color = getComputedStyle(document.documentElement).getPropertyValue("--accent").trim();
    item.querySelector("span")?.before(thumbnail(shape, color));
  }

  #acceptDrops(): void {
    const overlay = element("drop", HTMLElement);
    const hasFile = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    // Moving between elements fires one dragenter and one dragleave, so the depth is counted.
    let depth = 0;
    const setDepth = (value: number) => {
      depth = Math.max(0, value);
      overlay.hidden = depth === 0;
    };
    addEventListener("dragenter", (event) => hasFile(event) && setDepth(depth + 1));
    addEventListener("dragleave", (event) => hasFile(event) && setDepth(depth - 1));
    addEventListener("dragover", (event) => event.preventDefault());
    addEventListener("drop", (event) => {
      event.preventDefault();
      setDepth(0);
      void this.#addFiles(droppedFiles(event.dataTransfer));
    });
  }
}
