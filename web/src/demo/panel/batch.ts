// Many attempts in a row: how many lifted, which did not and why; each of those can be seen again.

import { element, h } from "../../common/dom";
import { percent } from "../../common/numbers";
import { outOf } from "../../common/strings";
import { save } from "../save";
import type { Attempted, Rectangle, ToWorker } from "../protocol";
import { BATCH } from "../strings";
import { AttemptTable } from "./attempts";
import { Places } from "./places";

export interface BatchEvents {
  send(message: ToWorker): void;
  // The seed from which the next attempts are drawn.
  seed(): number;
  // The policy that acts, and the one that is beside it, if one is.
  names(): string[];
  // Shows the attempt of this seed.
  replay(seed: number): void;
}

// Attempts of one policy.
interface Row {
  name: string;
  attempted: Attempted[];
  isOver: boolean;
}

export class BatchPanel {
  readonly #events: BatchEvents;
  readonly #button = element("batch-run", HTMLButtonElement);
  readonly #count = element("batch-count", HTMLSelectElement);
  readonly #bar = element("batch-bar", HTMLProgressElement);
  readonly #csv = element("batch-csv", HTMLButtonElement);
  readonly #words = element("batch-words", HTMLElement);
  readonly #beside = element("batch-beside", HTMLElement);
  readonly #failures = element("batch-failures", HTMLUListElement);
  readonly #places: Places;
  readonly #table: AttemptTable;
  // The policy that acts, and the one beside it, on the same seeds.
  #rows: Row[] = [];
  #wanted = 0;
  // Its number: what still comes of an earlier one is not counted.
  #run = 0;

  constructor(events: BatchEvents) {
    this.#events = events;
    this.#places = new Places((seed) => events.replay(seed));
    this.#table = new AttemptTable((seed) => events.replay(seed));
    this.#button.addEventListener("click", () => (this.#isRunning ? events.send({ kind: "cancel" }) : this.#begin()));
    this.#csv.addEventListener("click", () => save("attempts.csv", new Blob([csv(this.#rows)], { type: "text/csv" })));
  }

  get #isRunning(): boolean {
    return this.#rows.some(({ isOver }) => !isOver);
  }

  // Where objects may stand.
  limit(workspace: Rectangle): void {
    this.#places.limit(workspace);
  }

  // Whether attempts can begin.
  enable(on: boolean): void {
    this.#button.disabled = !on;
  }

  #begin(): void {
    this.#forget();
    this.#wanted = Number(this.#count.value);
    this.#rows = this.#events.names().map((name) => ({ name, attempted: [], isOver: false }));
    this.#show();
    this.#run += 1;
    this.#events.send({ kind: "batch", seed: this.#events.seed(), attempts: this.#wanted, run: this.#run });
  }

  // An attempt of the policy that acts (0) or of the one beside it (1); the map is that of the first.
  add(row: Attempted, who: 0 | 1): void {
    const own = this.#rows[who];
    if (!own || row.run !== this.#run) return;
    own.attempted.push(row);
    if (who === 0) this.#places.add(row);
    this.#table.add(row, this.#rows.length > 1 ? own.name : null);
    if (!row.lifted) this.#failures.append(this.#failure(own, row));
    this.#show();
  }

  // No more attempts come of one of them.
  end(who: 0 | 1, run: number | null): void {
    const row = this.#rows[who];
    if (!row || row.isOver || (run ?? this.#run) !== this.#run) return;
    row.isOver = true;
    this.#show();
    // Whoever does not see how they stand is told once.
    if (!this.#isRunning) element("announcement", HTMLElement).textContent = this.#beside.textContent || this.#words.textContent;
  }

  // Nobody who could go on is there; what was counted stays.
  stop(): void {
    for (const row of this.#rows) row.isOver = true;
    this.#show();
  }

  // Another object or policy: what was counted is not about it. The worker ends a row before it says so: one that goes on
  // was asked for since, and is.
  clear(): void {
    if (this.#rows[0]?.isOver === false) return;
    if (this.#isRunning) this.#events.send({ kind: "cancel" });
    this.#forget();
    this.#show();
  }

  #forget(): void {
    this.#rows = [];
    this.#failures.replaceChildren();
    this.#places.clear();
    this.#table.clear();
  }

  #show(): void {
    const [first, second] = this.#rows;
    this.#button.textContent = this.#isRunning ? BATCH.stop : BATCH.run;
    this.#bar.hidden = !this.#isRunning;
    this.#bar.max = this.#wanted * this.#rows.length;
    this.#bar.value = this.#rows.reduce((sum, { attempted }) => sum + attempted.length, 0);
    this.#words.textContent = first && first.attempted.length > 0 ? (second ? told : counted)(first) : "";
    this.#beside.textContent = first && second && second.attempted.length > 0 ? `${named(first)}, ${named(second)}. ${apart(first, second)}` : "";
    this.#csv.hidden = !first || first.attempted.length === 0;
  }

  // Both act again where one of them failed.
  #failure({ name }: Row, { seed, words }: Attempted): HTMLLIElement {
    const button = h("button", { type: "button", class: "quiet", click: () => this.#events.replay(seed) }, BATCH.watch);
    const ended = BATCH.ended(seed, words);
    return h("li", {}, h("span", {}, this.#rows.length > 1 ? BATCH.of(name, ended) : ended), button);
  }
}

function told({ attempted }: Row): string {
  return outOf(attempted.at(-1)?.row.lifted ?? 0, attempted.length);
}

// The same with its interval.
function counted(row: Row): string {
  const interval = row.attempted.at(-1)?.row.interval;
  return interval ? BATCH.between(told(row), percent(interval[0]), percent(interval[1])) : told(row);
}

function named(row: Row): string {
  return BATCH.of(row.name, counted(row));
}

// Attempts that one of two lifted and the other did not, of the seeds that both have tried.
function apart(first: Row, second: Row): string {
  const seconds = new Map(second.attempted.map(({ seed, lifted }) => [seed, lifted]));
  const both = first.attempted.filter(({ seed }) => seconds.has(seed));
  if (both.length === 0) return "";
  const alone = (of: boolean) => both.filter(({ seed, lifted }) => lifted === of && seconds.get(seed) === !of).length;
  return BATCH.alone(first.name, alone(true), second.name, alone(false), both.length);
}

function csv(rows: Row[]): string {
  const line = (name: string, { seed, pose, lifted, words, time, hash }: Attempted) =>
    [name, seed, pose.x, pose.y, pose.yaw, lifted, `"${words}"`, time.toFixed(3), hash].join(",");
  const lines = rows.flatMap(({ name, attempted }) => attempted.map((row) => line(name, row)));
  return ["policy,seed,x_m,y_m,yaw_rad,lifted,verdict,seconds,state_hash", ...lines, ""].join("\n");
}
