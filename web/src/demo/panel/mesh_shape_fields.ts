// Fields for the size and the up axis of a mesh file. They show the current object; a change imports it again.

import { element } from "../../common/dom";
import type { ImportOptions } from "../worker/messages";
import type { ObjectInfo, UpAxis } from "../worker/protocol";

export class MeshShapeFields {
  readonly #longest = element("longest-side", HTMLInputElement);
  readonly #scale = element("scale", HTMLInputElement);
  readonly #up = element("up-axis", HTMLSelectElement);
  #longestCm = 0;

  // Another size changes the volume, so the mass is estimated again.
  constructor(onChange: (change: Partial<ImportOptions>) => void) {
    this.#longest.addEventListener("change", () => {
      const cm = this.#longest.valueAsNumber;
      if (cm > 0) onChange({ sizeM: cm / 100, unit: null, scale: null, massKg: null });
    });
    // The field may hold an invalid size, or that of the previous object.
    this.#longest.addEventListener("blur", () => this.#writeLongest());
    this.#scale.addEventListener("change", () => {
      const scale = this.#scale.valueAsNumber;
      onChange({ scale: scale > 0 ? scale : null, sizeM: null, massKg: null });
    });
    this.#up.addEventListener("change", () => {
      onChange({ up: this.#up.value === "" ? null : (this.#up.value as UpAxis), orientation: null });
    });
  }

  show({ extentCm }: ObjectInfo): void {
    this.#longestCm = Math.max(...extentCm);
    if (document.activeElement !== this.#longest) this.#writeLongest();
  }

  showOptions({ scale, up }: ImportOptions): void {
    this.#scale.value = scale === null ? "" : String(scale);
    this.#up.value = up ?? "";
  }

  #writeLongest(): void {
    this.#longest.value = this.#longestCm.toFixed(1);
  }
}
