// Many attempts in a row: how many lifted, which did not and why; each of those can be seen again.

import { element, h } from "../../common/dom";
import { outOf } from "../../common/strings";
import { save } from "../save";
import type { Attempted, Rectangle, ToWorker } from "../protocol";
import { BATCH } from "../strings";
import { Places } from "./places";

export interface BatchEvents {
  send(message: ToWorker): void;
  // The seed from which the next attempts are drawn.
  seed(): number;
  // Shows the attempt of this seed.
  replay(seed: number): void;
}

export class BatchPanel {
  readonly #events: BatchEvents;
  readonly #run = element("batch-run", HTMLButtonElement);
  readonly #count = element("batch-count", HTMLSelectElement);
  readonly #bar = element("batch-bar", HTMLProgressElement);
  readonly #csv = element("batch-csv", HTMLButtonElement);
  readonly #words = element("batch-words", HTMLElement);
  readonly #failures = element("batch-failures", HTMLUListElement);
  readonly #places: Places;
  #rows: Attempted[] = [];
  #wanted = 0;
  #isRunning = false;

  constructor(events: BatchEvents) {
    this.#events = events;
    this.#places = new Places((seed) => events.replay(seed));
    this.#run.addEventListener("click", () => (this.#isRunning ? events.send({ kind: "cancel" }) : this.#begin()));
    this.#csv.addEventListener("click", () => save("attempts.csv", new Blob([csv(this.#rows)], { type: "text/csv" })));
  }

  // Where objects may stand.
  limit(workspace: Rectangle): void {
    this.#places.limit(workspace);
  }

  // Whether attempts can begin.
  enable(on: boolean): void {
    this.#run.disabled = !on;
  }

  #begin(): void {
    this.#forget();
    this.#wanted = Number(this.#count.value);
    this.#isRunning = true;
    this.#run.textContent = BATCH.stop;
    this.#bar.hidden = false;
    this.#show();
    this.#events.send({ kind: "batch", seed: this.#events.seed(), attempts: this.#wanted });
  }

  add(row: Attempted): void {
    this.#rows.push(row);
    this.#places.add(row);
    if (!row.lifted) this.#failures.append(this.#failure(row));
    this.#show();
  }

  end(): void {
    this.#isRunning = false;
    this.#run.textContent = BATCH.run;
    this.#bar.hidden = true;
  }

  // Another object or policy: what was counted is not about it.
  clear(): void {
    this.end();
    this.#forget();
    this.#show();
  }

  #forget(): void {
    this.#rows = [];
    this.#failures.replaceChildren();
    this.#places.clear();
  }

  #show(): void {
    const lifted = this.#rows.filter((row) => row.lifted).length;
    this.#bar.max = this.#wanted;
    this.#bar.value = this.#rows.length;
    this.#words.textContent = this.#rows.length > 0 ? outOf(lifted, this.#rows.length) : "";
    this.#csv.hidden = this.#rows.length === 0;
  }

  #failure({ seed, words }: Attempted): HTMLLIElement {
    const button = h("button", { type: "button", class: "quiet", click: () => this.#events.replay(seed) }, BATCH.watch);
    return h("li", {}, h("span", {}, BATCH.ended(seed, words)), button);
  }
}

function csv(rows: Attempted[]): string {
  const line = ({ seed, pose, lifted, words, time, hash }: Attempted) =>
    [seed, pose.x, pose.y, pose.yaw, lifted, `"${words}"`, time.toFixed(3), hash].join(",");
  return ["seed,x_m,y_m,yaw_rad,lifted,verdict,seconds,state_hash", ...rows.map(line), ""].join("\n");
}
