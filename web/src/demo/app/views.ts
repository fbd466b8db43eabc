// The view, its layers and camera presets, and the second view of a comparison.

import { choice, element } from "../../common/dom";
import type { ErrorCards } from "../panel/error_cards";
import { LayerSwitches } from "../panel/layers";
import type { Preset } from "../view/camera";
import { View, type ViewEvents } from "../view/view";
import type { EventBus } from "./event_bus";
import { ERRORS } from "./strings";

// Event handlers of the second view, which only displays.
const NO_EVENTS = { place: () => {}, drag: () => {}, fellBackTo2d: () => {}, viewChanged: () => {}, userMoved: () => {} };

export class Views {
  readonly #bus: EventBus;
  readonly #errors: ErrorCards;
  readonly layers: LayerSwitches;
  // The first view; null if nothing can be rendered.
  readonly first: View | null;
  readonly #pressCamera = choice("cameras", (preset) => this.goToPreset(preset as Preset));

  constructor(bus: EventBus, errors: ErrorCards, events: Pick<ViewEvents, "place" | "drag">) {
    [this.#bus, this.#errors] = [bus, errors];
    this.layers = new LayerSwitches((layer, on) => bus.emit({ kind: "layerSwitched", layer, on }));
    this.first = this.#create("view", bus, {
      ...events,
      viewChanged: (camera) => bus.emit({ kind: "cameraMoved", camera }),
      userMoved: () => this.#pressCamera(null),
      contextChanged: (isAvailable) => this.#showContext(isAvailable),
      fellBackTo2d: (why) => errors.report("webgl_unavailable", ERRORS.webglUnavailable(why)),
    });
    // The reconstruction is that of the previous encoder.
    bus.on("modelChanged", () => this.first?.clearReconstruction());
  }

  // Creates the second view, which shows the events of its own worker; null if nothing can be rendered.
  createSecond(worker: EventBus): View | null {
    const second = this.#create("view-2", worker, { ...NO_EVENTS, contextChanged: (isAvailable) => this.#showContext(isAvailable) });
    this.layers.apply((layer, on) => second?.setLayer(layer, on));
    return second;
  }

  goToPreset(preset: Preset): void {
    this.first?.goTo(preset);
    this.#pressCamera(preset === "home" ? null : preset);
  }

  #create(id: string, worker: EventBus, events: ViewEvents): View | null {
    try {
      const view = new View(element(id, HTMLCanvasElement), events);
      worker.on("ready", (ready) => view.show(ready));
      worker.on("object", (object) => view.showObject(object));
      worker.on("frame", (frame) => view.showFrame(frame));
      worker.on("cloud", (cloud) => view.showCloud(cloud));
      this.#bus.on("layerSwitched", ({ layer, on }) => view.setLayer(layer, on));
      return view;
    } catch (error) {
      this.#errors.report("graphics_unavailable", ERRORS.graphicsUnavailable(String(error)));
      return null;
    }
  }

  #showContext(isAvailable: boolean): void {
    if (isAvailable) this.#errors.dismiss("graphics_lost");
    else this.#errors.report("graphics_lost", ERRORS.graphicsLost);
  }
}
