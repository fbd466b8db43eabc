// Chart of one metric over steps or elapsed time, for one or several jobs.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { number } from "../common/numbers";
import { type MetricSeries, smooth } from "./metric_series";
import { CHARTS } from "./strings";

export interface ChartSettings {
  // Weight of past values: 0 (raw) to 0.99.
  smoothing: number;
  isLogY: boolean;
  isLogX: boolean;
  xAxis: "step" | "elapsed_s";
}

interface LabeledSeries {
  series: MetricSeries;
  label: string;
}

const HEIGHT = 220;
// uPlot synchronisation key: all charts of the page share cursor and zoom.
const SYNC_KEY = "jobs";

export class Chart {
  readonly element = document.createElement("figure");
  readonly #name: string;
  readonly #resizeObserver = new ResizeObserver(([entry]) => {
    if (entry && this.#plot) this.#plot.setSize({ width: entry.contentRect.width, height: HEIGHT });
  });
  #plot: uPlot | null = null;
  // Settings, labels and color scheme of the current plot.
  #plotKey = "";
  #redraw = () => {};
  readonly #onColorScheme = () => this.#redraw();

  constructor(name: string) {
    this.#name = name;
    const caption = document.createElement("figcaption");
    caption.textContent = name.replaceAll("_", " ").replaceAll(".", " · ");
    this.element.className = "chart";
    this.element.append(caption);
    this.#resizeObserver.observe(this.element);
    darkScheme.addEventListener("change", this.#onColorScheme);
  }

  // Releases the listeners that plots add to the window.
  close(): void {
    this.#resizeObserver.disconnect();
    darkScheme.removeEventListener("change", this.#onColorScheme);
    this.#plot?.destroy();
    this.#plot = null;
  }

  // Draws the metric of each series. Keeps the user's zoom unless the settings changed.
  show(series: LabeledSeries[], settings: ChartSettings): void {
    this.#redraw = () => this.show(series, settings);
    const tables = series.map((one) => points(one.series, this.#name, settings));
    const data = uPlot.join(tables.map(([x, raw, smoothed]) => [x, raw, smoothed] as uPlot.AlignedData));
    const labels = series.map(({ label }) => label);
    const key = JSON.stringify([settings, labels, darkScheme.matches]);
    if (this.#plot && this.#plotKey === key) {
      this.#plot.setData(data, this.#isUnzoomed());
      return;
    }
    this.#plotKey = key;
    this.#plot?.destroy();
    this.#plot = new uPlot(this.#options(labels, settings), data, this.element);
  }

  #isUnzoomed(): boolean {
    const plot = this.#plot;
    const x = plot?.data[0];
    const { min, max } = plot?.scales["x"] ?? {};
    return !x?.length || ((min ?? 0) <= x[0]! && (max ?? 0) >= x[x.length - 1]!);
  }

  #options(labels: string[], settings: ChartSettings): uPlot.Options {
    const css = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    const [ink, line] = [css("--muted"), css("--line")];
    const axis: uPlot.Axis = {
      stroke: ink,
      font: "12px Inter, system-ui, sans-serif",
      grid: { stroke: line, width: 1 },
      ticks: { stroke: line, width: 1 },
    };
    const value = (_: uPlot, shown: number | null) => (shown === null ? "–" : number(shown));
    const series = labels.flatMap((label, i): uPlot.Series[] => {
      const color = css(`--series-${(i % 6) + 1}`);
      const raw: uPlot.Series = {
        label: CHARTS.raw(label),
        stroke: color,
        alpha: settings.smoothing > 0 ? 0.25 : 0,
        width: 1,
        spanGaps: true,
        points: { show: false },
        value,
      };
      // A single value has no line: show a point.
      const points: uPlot.Series.Points = { show: ({ data }, at) => Array.from(data[at]!).filter((y) => y != null).length === 1, size: 7, fill: color };
      return [raw, { ...raw, label, alpha: 1, width: 1.6, points }];
    });
    const isTime = settings.xAxis === "elapsed_s";
    return {
      width: Math.max(200, this.element.clientWidth),
      height: HEIGHT,
      cursor: { sync: { key: SYNC_KEY }, bind: { mousedown: onMouseDown } },
      scales: {
        x: { time: false, ...(settings.isLogX && { distr: 3 as const, range: exactRange }) },
        y: { distr: settings.isLogY ? 3 : 1 },
      },
      axes: [
        { ...axis, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : isTime ? timeLabel(tick) : shortNumber(tick))) },
        { ...axis, size: 58, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : shortNumber(tick))) },
      ],
      legend: { markers: { width: 0 } },
      series: [{ label: isTime ? CHARTS.time : CHARTS.step, value: (_, x) => (x === null ? "–" : isTime ? timeLabel(x) : x.toLocaleString("en")) }, ...series],
    };
  }
}

// The primary button zooms; with Shift it pans.
function onMouseDown(plot: uPlot, over: HTMLElement, zoom: uPlot.Cursor.MouseListener): uPlot.Cursor.MouseListener {
  return (event) => {
    if (event.button !== 0 || event.target !== over) return null;
    return event.shiftKey ? pan(plot, event) : zoom(event);
  };
}

// Pans all charts with the pointer until the button is released.
function pan(plot: uPlot, from: MouseEvent): null {
  const { min, max, distr } = plot.scales["x"] ?? {};
  if (min == null || max == null) return null;
  const [toLinear, fromLinear] = distr === 3 ? [Math.log10, (x: number) => 10 ** x] : [Number, Number];
  const [left, right] = [toLinear(min), toLinear(max)];
  const drag = ({ clientX }: MouseEvent) => {
    const offset = ((from.clientX - clientX) / plot.over.clientWidth) * (right - left);
    for (const chart of uPlot.sync(SYNC_KEY).plots) {
      chart.setScale("x", { min: fromLinear(left + offset), max: fromLinear(right + offset) });
    }
  };
  addEventListener("mousemove", drag);
  addEventListener("mouseup", () => removeEventListener("mousemove", drag), { once: true });
  return null;
}

// Log-axis range without uPlot's rounding to powers of ten.
function exactRange(_: uPlot, min: number | null, max: number | null): uPlot.Range.MinMax {
  return min !== null && max !== null && min === max ? uPlot.rangeLog(min, max, 10, true) : [min, max];
}

const darkScheme = matchMedia("(prefers-color-scheme: dark)");

// x, raw and smoothed values of a metric. Log axes skip non-positive values.
function points({ columns }: MetricSeries, name: string, settings: ChartSettings): [number[], (number | null)[], (number | null)[]] {
  const all = columns[settings.xAxis] ?? [];
  const values = columns[name] ?? [];
  const x: number[] = [];
  const y: number[] = [];
  all.forEach((at, i) => {
    const value = values[i];
    if (typeof at !== "number" || typeof value !== "number") return;
    if ((settings.isLogX && at <= 0) || (settings.isLogY && value <= 0) || at === x[x.length - 1]) return;
    x.push(at);
    y.push(value);
  });
  return [x, y, smooth(y, settings.smoothing)];
}

function shortNumber(value: number): string {
  const size = Math.abs(value);
  if (size >= 1e6) return `${value / 1e6}M`;
  if (size >= 1e4) return `${value / 1e3}k`;
  return String(Number(value.toPrecision(6)));
}

function timeLabel(seconds: number): string {
  if (seconds < 100) return `${Number(seconds.toFixed(1))} s`;
  const minutes = seconds / 60;
  return minutes < 100 ? `${Number(minutes.toFixed(1))} min` : `${Number((minutes / 60).toFixed(1))} h`;
}
