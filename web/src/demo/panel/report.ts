// What was found out about the object, and what of a file to set right: unit, mass, side.

import { choice, element, h } from "../../common/dom";
import type { Report, Stands, Told, Unit } from "../protocol";
import { REPORT } from "../strings";

export class ReportCard {
  readonly #box = element("report", HTMLElement);
  readonly #size = element("report-size", HTMLElement);
  readonly #mass = element("report-mass", HTMLElement);
  readonly #mesh = element("report-mesh", HTMLElement);
  readonly #fits = element("report-fits", HTMLElement);
  readonly #likeness = element("report-likeness", HTMLElement);
  readonly #file = element("report-file", HTMLElement);
  readonly #reason = element("report-reason", HTMLElement);
  readonly #notes = element("report-notes", HTMLElement);
  readonly #grams = element("mass", HTMLInputElement);
  readonly #sides = element("sides", HTMLSelectElement);
  #massKg = 0;
  readonly #press: (unit: string | null) => void;

  constructor(change: (part: Partial<Told>) => void) {
    // In another unit it has another mass, and the guess is made anew.
    this.#press = choice("unit-choice", (value) => change({ unit: value as Unit, massKg: null }));
    this.#grams.addEventListener("change", () => {
      const grams = this.#grams.valueAsNumber;
      change({ massKg: grams > 0 ? grams / 1000 : null });
    });
    // What was typed may be no mass, or of another object.
    this.#grams.addEventListener("blur", () => this.#writeMass());
    this.#sides.addEventListener("change", () => {
      const side = Number(this.#sides.value);
      change({ stands: side < 0 ? "asInFile" : { on: side } });
    });
  }

  // What the encoder makes of it is known once it was looked at, where one was asked.
  showLikeness(words: string | null): void {
    this.#likeness.textContent = words;
    if (this.#likeness.parentElement) this.#likeness.parentElement.hidden = words === null;
  }

  show(report: Report): void {
    this.showLikeness(null);
    this.#box.hidden = false;
    this.#size.textContent = `${report.extentCm.map((side) => side.toFixed(1)).join(" × ")} cm`;
    this.#mass.textContent = massInWords(report.massKg);
    this.#mesh.textContent = REPORT.mesh(report.triangles.toLocaleString("en"), report.watertight, report.parts);
    this.#fits.textContent = report.fits;
    this.#file.hidden = report.unit === null;
    this.#press(report.unit);
    this.#reason.textContent = report.reason ?? "";
    this.#massKg = report.massKg;
    if (document.activeElement !== this.#grams) this.#writeMass();
    this.#showSides(report);
    this.#notes.hidden = report.notes.length === 0;
    this.#notes.replaceChildren(...report.notes.map((note) => h("li", {}, note)));
  }

  #writeMass(): void {
    this.#grams.value = String(Math.round(1000 * this.#massKg));
  }

  #showSides({ sides, stands }: Report): void {
    const names = [REPORT.asInFile, ...Array.from({ length: sides }, (_, i) => (i === 0 ? REPORT.steadiest : REPORT.onSide(i + 1)))];
    this.#sides.replaceChildren(...names.map((name, i) => h("option", { value: i - 1 }, name)));
    this.#sides.value = String(sideOf(stands));
  }
}

function sideOf(stands: Stands | null): number {
  return stands === null || stands === "asInFile" ? -1 : stands.on;
}

function massInWords(kg: number): string {
  return kg < 1 ? `${(kg * 1000).toFixed(0)} g` : `${kg.toFixed(2)} kg`;
}
