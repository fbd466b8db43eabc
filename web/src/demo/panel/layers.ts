// What is drawn beside robot and object, each layer with its switch.

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

  constructor(changed: (layer: Layer, on: boolean) => void) {
    for (const [layer, input] of this.#all()) input.addEventListener("change", () => changed(layer, input.checked));
  }

  press(layer: Layer): void {
    this.#inputs[layer].click();
  }

  // How they stand now.
  apply(set: (layer: Layer, on: boolean) => void): void {
    for (const [layer, { checked }] of this.#all()) set(layer, checked);
  }

  #all(): [Layer, HTMLInputElement][] {
    return Object.entries(this.#inputs) as [Layer, HTMLInputElement][];
  }
}
