// Form in an error card that asks for the size of a mesh: neither the file nor its format tells it.

import { h } from "../../common/dom";
import { SIZE_FORM } from "../app/strings";

// Length units of the form (m).
const UNITS = { mm: 0.001, cm: 0.01, m: 1, in: 0.0254 } as const;
const DEFAULT_UNIT = "cm";

// `use` receives the length of the longest side (m).
export function sizeForm(use: (sizeM: number) => void): HTMLFormElement {
  const length = h("input", { type: "number", min: "0", step: "any", inputmode: "decimal", required: true, "aria-label": SIZE_FORM.length });
  const unit = h("select", { "aria-label": SIZE_FORM.unit }, ...Object.keys(UNITS).map((name) => h("option", {}, name)));
  unit.value = DEFAULT_UNIT;
  const submit = (event: Event) => {
    event.preventDefault();
    const sizeM = length.valueAsNumber * UNITS[unit.value as keyof typeof UNITS];
    if (sizeM > 0) use(sizeM);
  };
  return h("form", { class: "size-form", submit }, h("label", { class: "field" }, SIZE_FORM.length, length), unit, h("button", { type: "submit" }, SIZE_FORM.use));
}
