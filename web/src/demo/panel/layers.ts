// Switches of the overlay layers.

import { element } from "../../common/dom";
import type { Layer } from "../view/view";

export class LayerSwitches {
  readonly #inputs: Record<Layer, HTMLInputElement> = {
    cloud: element("layer-cloud", HTMLInputElement),
    reconstruction: element("layer-reconstruction", HTMLInputElement),
    hulls: element("layer-hulls", HTMLInputElement),
    forces: element("layer-forces", HTMLInputElement),
    trail: element("layer-trail", HTMLInputElement),
    target: element("layer-target", HTMLInputElement),
    limits: element("layer-limits", HTMLInputElement),
    sensor: element("layer-sensor", HTMLInputElement),
  };

  constructor(onChange: (layer: Layer, on: boolean) => void) {
    for (const [layer, input] of this.#entries()) input.addEventListener("change", () => onChange(layer, input.checked));
  }

  toggle(layer: Layer): void {
    this.#inputs[layer].click();
  }

  // Calls `set` with the current state of each layer.
  apply(set: (layer: Layer, on: boolean) => void): void {
    for (const [layer, { checked }] of this.#entries()) set(layer, checked);
  }

  #entries(): [Layer, HTMLInputElement][] {
    return Object.entries(this.#inputs) as [Layer, HTMLInputElement][];
  }
}
