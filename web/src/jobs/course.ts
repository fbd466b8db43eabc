// What a job measured: columns of numbers that grow while it runs.

import { ask } from "../common/api";
import type { Columns, JobEvent } from "./types";

// Points that are fetched, and half of those that are kept at most; a picture is not wider.
const MOST = 2000;

export class Course {
  readonly id: string;
  columns: Columns = { step: [], wall: [] };
  // When the job began (ms): one that waits is told later.
  readonly #began: () => number;
  // What was measured while the rest is fetched, for each time that it is.
  readonly #meanwhile = new Set<JobEvent[]>();
  #asked = 0;
  #answered = 0;

  constructor(id: string, began: () => number) {
    this.id = id;
    this.#began = began;
  }

  async fetch(): Promise<void> {
    const meanwhile: JobEvent[] = [];
    this.#meanwhile.add(meanwhile);
    const asked = ++this.#asked;
    let columns: Columns;
    try {
      columns = await ask<Columns>(`jobs/${this.id}/metrics?max_points=${MOST}`);
    } finally {
      this.#meanwhile.delete(meanwhile);
    }
    // What was asked for later has more, and may be here already.
    if (asked < this.#answered) return;
    this.#answered = asked;
    this.columns = columns;
    this.columns["wall"] ??= [];
    for (const event of meanwhile) this.add(event);
  }

  // Adds what was measured just now; true if it was new.
  add(event: JobEvent): boolean {
    for (const meanwhile of this.#meanwhile) meanwhile.push(event);
    const { step, ...values } = event.data as { step?: number };
    const steps = this.columns["step"] ?? [];
    if (typeof step !== "number") return false;
    const at = steps.length - 1;
    const isSame = steps[at] === step;
    if (!isSame && step < (steps[at] ?? 0)) return false;
    const row: Record<string, unknown> = {
      ...values,
      step,
      wall: (Date.parse(event.created_at) - this.#began()) / 1000,
    };
    const length = isSame ? steps.length : steps.length + 1;
    for (const name of new Set([...Object.keys(this.columns), ...Object.keys(row)])) {
      const column = (this.columns[name] ??= []);
      while (column.length < length) column.push(null);
      const value = row[name];
      if (typeof value === "number") column[length - 1] = value;
    }
    // The server thins so that no peak is lost; if it does not answer, it is asked at the next point again.
    if (length > 2 * MOST && this.#meanwhile.size === 0) this.fetch().catch(() => undefined);
    return true;
  }

  // Names of what was measured, but for what only says how fast.
  names(): string[] {
    const isNumber = (name: string) => this.columns[name]?.some((value) => typeof value === "number");
    return Object.keys(this.columns).filter((name) => !["step", "wall", "seconds_left"].includes(name) && isNumber(name));
  }
}

// Each value drawn towards the ones before it, as much as is asked for (0 to 1); corrected for its beginning.
export function smoothed(values: (number | null)[], amount: number): (number | null)[] {
  let [mean, weight] = [0, 0];
  return values.map((value) => {
    if (typeof value !== "number") return null;
    mean = amount * mean + (1 - amount) * value;
    weight = amount * weight + (1 - amount);
    return mean / weight;
  });
}
