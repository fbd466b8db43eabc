// Metrics of a job: columns that grow while the job runs.

import { requestJson } from "../common/api";
import type { Columns, JobEvent } from "./types";

// Number of points per request. Twice as many trigger a new, downsampled request; charts are not wider.
const MAX_POINTS = 2000;

export class MetricSeries {
  readonly id: string;
  columns: Columns = { step: [], elapsed_s: [] };
  // Start time of the job (ms). A queued job gets it later.
  readonly #startTime: () => number;
  // Metric events that arrived during a request, for each pending request.
  readonly #pending = new Set<JobEvent[]>();
  #numRequests = 0;
  #latestResponse = 0;

  constructor(id: string, startTime: () => number) {
    this.id = id;
    this.#startTime = startTime;
  }

  async fetch(): Promise<void> {
    const arrived: JobEvent[] = [];
    this.#pending.add(arrived);
    const request = ++this.#numRequests;
    let columns: Columns;
    try {
      columns = await requestJson<Columns>(`jobs/${this.id}/metrics?max_points=${MAX_POINTS}`);
    } finally {
      this.#pending.delete(arrived);
    }
    // The response of a later request, with more points, may have arrived first.
    if (request < this.#latestResponse) return;
    this.#latestResponse = request;
    this.columns = columns;
    this.columns["elapsed_s"] ??= [];
    for (const event of arrived) this.add(event);
  }

  // Adds a metric event. Returns whether it was new.
  add(event: JobEvent): boolean {
    for (const arrived of this.#pending) arrived.push(event);
    const { step, ...values } = event.data as { step?: number };
    const steps = this.columns["step"] ?? [];
    if (typeof step !== "number") return false;
    const last = steps.length - 1;
    const isSame = steps[last] === step;
    if (!isSame && step < (steps[last] ?? 0)) return false;
    const row: Record<string, unknown> = {
      ...values,
      step,
      elapsed_s: (Date.parse(event.created_at) - this.#startTime()) / 1000,
    };
    const length = isSame ? steps.length : steps.length + 1;
    for (const name of new Set([...Object.keys(this.columns), ...Object.keys(row)])) {
      const column = (this.columns[name] ??= []);
      while (column.length < length) column.push(null);
      const value = row[name];
      if (typeof value === "number") column[length - 1] = value;
    }
    // The server downsamples without losing peaks. A failed request is repeated at the next point.
    if (length > 2 * MAX_POINTS && this.#pending.size === 0) this.fetch().catch(() => undefined);
    return true;
  }

  // Names of the metrics, without the axes and the remaining time.
  names(): string[] {
    const isNumber = (name: string) => this.columns[name]?.some((value) => typeof value === "number");
    return Object.keys(this.columns).filter((name) => !["step", "elapsed_s", "seconds_left"].includes(name) && isNumber(name));
  }
}

// Exponential moving average with weight `amount` (0 to 1) on the past, corrected for its initialisation at zero.
export function smooth(values: (number | null)[], amount: number): (number | null)[] {
  let [mean, weight] = [0, 0];
  return values.map((value) => {
    if (typeof value !== "number") return null;
    mean = amount * mean + (1 - amount) * value;
    weight = amount * weight + (1 - amount);
    return mean / weight;
  });
}
