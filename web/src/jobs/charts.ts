// Metric charts of one or several jobs, with shared display settings.

import { h } from "../common/dom";
import { caughtErrorCard } from "../common/components";
import { Chart, type ChartSettings } from "./chart";
import type { JobFeed } from "./job_feed";
import { MetricSeries } from "./metric_series";
import { CHARTS } from "./strings";
import { type Job, title } from "./types";

// Name prefixes of the metrics that are shown first.
const FIRST = ["loss", "validation"];
// Minimum time between redraws.
const REDRAW_INTERVAL_MS = 500;

export class Charts {
  readonly element = h("section", { class: "charts", hidden: true });
  readonly #grid = h("div", { class: "grid" });
  // Error of the last request.
  readonly #error = h("div");
  readonly #charts = new Map<string, Chart>();
  readonly #series: { series: MetricSeries; label: string }[];
  readonly #settings: ChartSettings = storedSettings();
  #timer = 0;
  // Only the latest request reports its error.
  #numRequests = 0;
  #isClosed = false;
  readonly #unsubscribe: () => void;

  constructor(feed: JobFeed, jobs: Job[]) {
    this.element.append(h("h2", {}, CHARTS.title), this.#controls(), this.#error, this.#grid);
    const startTime = ({ started_at, created_at }: Job) => Date.parse(started_at ?? created_at);
    this.#series = jobs.map((job) => ({
      series: new MetricSeries(job.id, () => startTime(feed.jobs.get(job.id) ?? job)),
      label: jobs.length === 1 ? CHARTS.value : title(job),
    }));
    void this.#fetch();
    this.#unsubscribe = feed.listen({
      event: (event) => {
        const known = this.#series.find(({ series }) => series.id === event.job);
        if (event.type === "metric" && known?.series.add(event)) this.#scheduleDraw();
      },
      // Fetch metrics that were missed while the connection was lost.
      connection: (state) => state === "live" && void this.#fetch(),
    });
  }

  // Draws the metrics that could be fetched and shows the first error.
  async #fetch(): Promise<void> {
    const request = ++this.#numRequests;
    const results = await Promise.allSettled(this.#series.map(({ series }) => series.fetch()));
    if (request !== this.#numRequests) return;
    const failed = results.find(({ status }) => status === "rejected") as PromiseRejectedResult | undefined;
    this.#error.replaceChildren(...(failed ? [caughtErrorCard(failed.reason)] : []));
    this.#draw();
  }

  close(): void {
    this.#isClosed = true;
    this.#unsubscribe();
    clearTimeout(this.#timer);
    for (const chart of this.#charts.values()) chart.close();
  }

  #scheduleDraw(): void {
    this.#timer ||= window.setTimeout(() => {
      this.#timer = 0;
      this.#draw();
    }, REDRAW_INTERVAL_MS);
  }

  #draw(): void {
    // A response may arrive after the view was closed.
    if (this.#isClosed) return;
    const names = [...new Set(this.#series.flatMap(({ series }) => series.names()))];
    const rank = (name: string) => (FIRST.findIndex((first) => name.startsWith(first)) + FIRST.length + 1) % (FIRST.length + 1);
    names.sort((a, b) => rank(a) - rank(b));
    this.element.hidden = names.length === 0 && this.#error.childElementCount === 0;
    for (const name of names) {
      let chart = this.#charts.get(name);
      if (!chart) {
        chart = new Chart(name);
        this.#charts.set(name, chart);
        this.#grid.append(chart.element);
      }
      chart.show(this.#series, this.#settings);
    }
  }

  #controls(): HTMLElement {
    const settings = this.#settings;
    const apply = () => {
      sessionStorage.setItem(SETTINGS_KEY, JSON.stringify(settings));
      this.#draw();
    };
    const checkbox = (text: string, name: "isLogX" | "isLogY") => {
      const input = h("input", { type: "checkbox", change: () => ((settings[name] = input.checked), apply()) });
      input.checked = settings[name];
      return h("label", {}, input, text);
    };
    const slider = h("input", {
      type: "range",
      min: 0,
      max: 0.99,
      step: 0.01,
      input: () => ((settings.smoothing = slider.valueAsNumber), apply()),
    });
    slider.valueAsNumber = settings.smoothing;
    const axis = h(
      "select",
      { "aria-label": CHARTS.axis, change: () => ((settings.xAxis = axis.value as ChartSettings["xAxis"]), apply()) },
      h("option", { value: "step" }, CHARTS.byStep),
      h("option", { value: "elapsed_s" }, CHARTS.byTime),
    );
    axis.value = settings.xAxis;
    const hint = h("span", { class: "hint" }, CHARTS.hint);
    const smoothing = h("label", {}, CHARTS.smoothing, slider);
    return h("div", { class: "controls" }, smoothing, checkbox(CHARTS.logY, "isLogY"), checkbox(CHARTS.logX, "isLogX"), axis, hint);
  }
}

const SETTINGS_KEY = "ngf-chart-settings";

function storedSettings(): ChartSettings {
  const defaults: ChartSettings = { smoothing: 0.6, isLogY: true, isLogX: false, xAxis: "step" };
  try {
    return { ...defaults, ...(JSON.parse(sessionStorage.getItem(SETTINGS_KEY) ?? "{}") as Partial<ChartSettings>) };
  } catch {
    return defaults;
  }
}
