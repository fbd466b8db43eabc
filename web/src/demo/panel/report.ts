// What was found out about the object, and the unit of a file to set right.

import { choice, element } from "../dom";
import type { Report, Unit } from "../protocol";

export class ReportCard {
  readonly #box = element("report", HTMLElement);
  readonly #size = element("report-size", HTMLElement);
  readonly #mass = element("report-mass", HTMLElement);
  readonly #mesh = element("report-mesh", HTMLElement);
  readonly #units = element("units", HTMLElement);
  readonly #reason = element("report-reason", HTMLElement);
  readonly #notes = element("report-notes", HTMLElement);
  readonly #press: (unit: string | null) => void;

  constructor(unitChosen: (unit: Unit) => void) {
    this.#press = choice("unit-choice", (value) => unitChosen(value as Unit));
  }

  show(report: Report): void {
    this.#box.hidden = false;
    this.#size.textContent = `${report.extentCm.map((side) => side.toFixed(1)).join(" × ")} cm`;
    this.#mass.textContent = massInWords(report.massKg);
    this.#mesh.textContent = meshInWords(report);
    this.#units.hidden = report.unit === null;
    this.#press(report.unit);
    this.#reason.textContent = report.reason ?? "";
    this.#notes.hidden = report.notes.length === 0;
    this.#notes.replaceChildren(...report.notes.map(listItem));
  }
}

function massInWords(kg: number): string {
  return kg < 1 ? `${(kg * 1000).toFixed(0)} g` : `${kg.toFixed(2)} kg`;
}

function meshInWords({ triangles, watertight, parts }: Report): string {
  const count = triangles.toLocaleString("en");
  const closed = watertight ? "watertight" : "open";
  return `${count} triangles, ${closed}, ${parts} convex ${parts === 1 ? "part" : "parts"}`;
}

function listItem(text: string): HTMLLIElement {
  const item = document.createElement("li");
  item.textContent = text;
  return item;
}
