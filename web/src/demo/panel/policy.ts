// Which policy acts. The address says it too, so that the page comes back with the same one.

import { element, h } from "../../common/dom";
import { fillWhenWanted, offer } from "../policies";
import { COMPARISON } from "../strings";

export class PolicyPicker {
  readonly #choice = element("policy", HTMLSelectElement);

  constructor(asked: string, choose: (id: string) => void) {
    offer(this.#choice, asked);
    this.#choice.value = asked;
    fillWhenWanted(this.#choice);
    this.#choice.addEventListener("change", () => choose(this.#choice.value));
  }

  // The address no longer asks for what a link or a training brought.
  leaveLink(): void {
    const address = new URL(location.href);
    address.searchParams.delete("training");
    address.hash = "";
    history.replaceState(null, "", address);
  }

  // Who acts now: where another one could not be had, the one before still does. None is chosen while the planner acts.
  show(id: string | null): void {
    if (id === null) {
      const nobody = h("option", { value: "", hidden: true }, COMPARISON.planner);
      if (!this.#choice.querySelector("[value='']")) this.#choice.prepend(nobody);
      this.#choice.value = "";
      return;
    }
    offer(this.#choice, id);
    this.#choice.value = id;
    const address = new URL(location.href);
    if ((address.searchParams.get("model") ?? "default") === id) return;
    if (id === "default") address.searchParams.delete("model");
    else address.searchParams.set("model", id);
    history.replaceState(null, "", address);
  }
}
