// Policy selection. The selected policy is also stored in the page's URL.

import { element, h } from "../../common/dom";
import type { EventBus } from "../app/event_bus";
import { COMPARISON } from "../app/strings";
import { addOption, fillWithModels } from "./policy_options";

export class PolicyPicker {
  readonly #select = element("policy", HTMLSelectElement);

  constructor(bus: EventBus, requested: string, onSelect: (id: string) => void) {
    addOption(this.#select, requested);
    this.#select.value = requested;
    fillWithModels(this.#select, bus);
    this.#select.addEventListener("change", () => {
      this.#clearLink();
      onSelect(this.#select.value);
    });
    bus.on("model", ({ id }) => this.#show(id));
  }

  // Removes the share link and the training from the URL.
  #clearLink(): void {
    const url = new URL(location.href);
    url.searchParams.delete("training");
    url.hash = "";
    history.replaceState(null, "", url);
  }

  // Shows the loaded policy, which differs from the selected one if that failed to load. Null: the planner is
  // used.
  #show(id: string | null): void {
    if (id === null) {
      const planner = h("option", { value: "", hidden: true }, COMPARISON.planner);
      if (!this.#select.querySelector("[value='']")) this.#select.prepend(planner);
      this.#select.value = "";
      return;
    }
    addOption(this.#select, id);
    this.#select.value = id;
    const url = new URL(location.href);
    if ((url.searchParams.get("model") ?? "default") === id) return;
    if (id === "default") url.searchParams.delete("model");
    else url.searchParams.set("model", id);
    history.replaceState(null, "", url);
  }
}
