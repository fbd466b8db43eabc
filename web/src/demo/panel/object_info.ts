// Object information, and the import options of a mesh file: size, up axis, mass, orientation.

import { MASS_LIMITS_KG } from "../../common/constants";
import { choice, element, h } from "../../common/dom";
import type { EventBus } from "../app/event_bus";
import { OBJECT_INFO } from "../app/strings";
import type { ImportOptions } from "../worker/messages";
import type { ObjectInfo, Orientation, Unit } from "../worker/protocol";
import { MeshShapeFields } from "./mesh_shape_fields";

export class ObjectInfoPanel {
  readonly #box = element("object-info", HTMLElement);
  readonly #size = element("info-size", HTMLElement);
  readonly #mass = element("info-mass", HTMLElement);
  readonly #mesh = element("info-mesh", HTMLElement);
  readonly #hand = element("info-hand", HTMLElement);
  readonly #familiarity = element("info-familiarity", HTMLElement);
  readonly #file = element("info-file", HTMLElement);
  readonly #unitReason = element("info-unit-reason", HTMLElement);
  readonly #notes = element("info-notes", HTMLElement);
  readonly #grams = element("mass", HTMLInputElement);
  readonly #orientation = element("orientation", HTMLSelectElement);
  readonly #shape: MeshShapeFields;
  #massKg = 0;
  readonly #pressUnit: (unit: string | null) => void;

  constructor(bus: EventBus, onChange: (change: Partial<ImportOptions>) => void) {
    // A new unit changes the volume, so the mass is estimated again.
    this.#pressUnit = choice("unit-choice", (value) => onChange({ unit: value as Unit, sizeM: null, massKg: null }));
    this.#shape = new MeshShapeFields(onChange);
    this.#grams.addEventListener("change", () => {
      const kg = this.#grams.valueAsNumber / 1000;
      const [min, max] = MASS_LIMITS_KG;
      onChange({ massKg: kg > 0 ? Math.min(Math.max(kg, min), max) : null });
    });
    // The field may hold an invalid mass, or that of the previous object.
    this.#grams.addEventListener("blur", () => this.#writeMass());
    this.#orientation.addEventListener("change", () => {
      const index = Number(this.#orientation.value);
      onChange({ orientation: index < 0 ? "asInFile" : { stablePose: index } });
    });
    bus.on("object", ({ info }) => this.#show(info));
    bus.on("cloud", ({ familiarity }) => this.#showFamiliarity(familiarity));
    // The familiarity is that of the previous encoder.
    bus.on("modelChanged", () => this.#showFamiliarity(null));
  }

  // Import options of the current mesh file.
  showOptions(options: ImportOptions): void {
    this.#shape.showOptions(options);
  }

  // Known only after the first attempt with an encoder; null hides it.
  #showFamiliarity(text: string | null): void {
    this.#familiarity.textContent = text;
    if (this.#familiarity.parentElement) this.#familiarity.parentElement.hidden = text === null;
  }

  #show(info: ObjectInfo): void {
    this.#showFamiliarity(null);
    this.#box.hidden = false;
    this.#size.textContent = `${info.extentCm.map((side) => side.toFixed(1)).join(" × ")} cm`;
    this.#mass.textContent = massText(info.massKg);
    this.#mesh.textContent = OBJECT_INFO.mesh(info.triangles.toLocaleString("en"), info.watertight, info.convexParts);
    this.#hand.textContent = info.graspability;
    this.#file.hidden = info.unit === null;
    this.#pressUnit(info.unit);
    this.#shape.show(info);
    this.#unitReason.textContent = info.unitReason ?? "";
    this.#massKg = info.massKg;
    if (document.activeElement !== this.#grams) this.#writeMass();
    this.#showOrientations(info);
    this.#notes.hidden = info.notes.length === 0;
    this.#notes.replaceChildren(...info.notes.map((note) => h("li", {}, note)));
  }

  #writeMass(): void {
    this.#grams.value = String(Math.round(1000 * this.#massKg));
  }

  #showOrientations({ stablePoses, orientation }: ObjectInfo): void {
    const faces = Array.from({ length: stablePoses }, (_, i) => (i === 0 ? OBJECT_INFO.mostStable : OBJECT_INFO.face(i + 1)));
    const labels = [OBJECT_INFO.asInFile, ...faces];
    this.#orientation.replaceChildren(...labels.map((label, i) => h("option", { value: i - 1 }, label)));
    this.#orientation.value = String(indexOf(orientation));
  }
}

// Index of a stable pose; -1 is the orientation of the file.
function indexOf(orientation: Orientation | null): number {
  return orientation === null || orientation === "asInFile" ? -1 : orientation.stablePose;
}

function massText(kg: number): string {
  return kg < 1 ? `${(kg * 1000).toFixed(0)} g` : `${kg.toFixed(2)} kg`;
}
