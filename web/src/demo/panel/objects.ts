// Choosing an object: from the list, by button, or dropped anywhere on the page.

import { element } from "../dom";
import type { Ready, Unit } from "../protocol";

export interface ObjectEvents {
  load(name: string): void;
  upload(file: File, unit: Unit | null): void;
}

export class ObjectPicker {
  readonly #events: ObjectEvents;
  readonly #list = element("objects", HTMLFieldSetElement);
  readonly #button = element("upload", HTMLButtonElement);
  readonly #input = element("file", HTMLInputElement);

  constructor(events: ObjectEvents) {
    this.#events = events;
    this.#button.addEventListener("click", () => this.#input.click());
    this.#input.addEventListener("change", () => {
      this.#take(this.#input.files);
      // So that the same file can be chosen again.
      this.#input.value = "";
    });
    this.#acceptDrops();
  }

  show(objects: Ready["objects"]): void {
    this.#list.querySelectorAll("label").forEach((label) => label.remove());
    for (const { name, label } of objects) {
      const input = document.createElement("input");
      input.type = "radio";
      input.name = "object";
      input.value = name;
      input.addEventListener("change", () => this.#events.load(name));
      const choice = document.createElement("label");
      choice.append(input, label);
      this.#button.before(choice);
    }
    this.#button.disabled = false;
  }

  // Marks a built-in object, or else the upload by its label.
  select(name: string | null, label: string): void {
    for (const input of this.#list.querySelectorAll("input")) input.checked = input.value === name;
    this.#button.classList.toggle("is-chosen", name === null);
    if (name === null) this.#button.textContent = label;
  }

  #take(files: FileList | null | undefined): void {
    const file = files?.[0];
    if (file) this.#events.upload(file, null);
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
      this.#take(event.dataTransfer?.files);
    });
  }
}
