// The course of one quantity over steps or time, for one job or several.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { number } from "../common/numbers";
import { type Course, smoothed } from "./course";
import { CHARTS } from "./strings";

export interface Look {
  // From 0, as it is, to almost 1.
  smoothing: number;
  isLogY: boolean;
  isLogX: boolean;
  by: "step" | "wall";
}

const HEIGHT = 220;
// Charts that are zoomed together.
const TOGETHER = "jobs";

export class Chart {
  readonly element = document.createElement("figure");
  readonly #name: string;
  readonly #resized = new ResizeObserver(([entry]) => {
    if (entry && this.#plot) this.#plot.setSize({ width: entry.contentRect.width, height: HEIGHT });
  });
  #plot: uPlot | null = null;
  #shown = "";
  #draw = () => {};
  readonly #recolored = () => this.#draw();

  constructor(name: string) {
    this.#name = name;
    const caption = document.createElement("figcaption");
    caption.textContent = name.replaceAll("_", " ").replaceAll(".", " · ");
    this.element.className = "chart";
    this.element.append(caption);
    this.#resized.observe(this.element);
    scheme.addEventListener("change", this.#recolored);
  }

  // Plots listen to the whole window.
  close(): void {
    this.#resized.disconnect();
    scheme.removeEventListener("change", this.#recolored);
    this.#plot?.destroy();
    this.#plot = null;
  }

  // Draws it anew; where somebody has zoomed in, that stays.
  show(courses: { course: Course; label: string }[], look: Look): void {
    this.#draw = () => this.show(courses, look);
    const tables = courses.map(({ course }) => points(course, this.#name, look));
    const data = uPlot.join(tables.map(([x, raw, smooth]) => [x, raw, smooth] as uPlot.AlignedData));
    const key = JSON.stringify([look, courses.map(({ label }) => label), scheme.matches]);
    if (this.#plot && this.#shown === key) {
      this.#plot.setData(data, this.#isWhole());
      return;
    }
    this.#shown = key;
    this.#plot?.destroy();
    this.#plot = new uPlot(this.#options(courses.map(({ label }) => label), look), data, this.element);
  }

  #isWhole(): boolean {
    const plot = this.#plot;
    const x = plot?.data[0];
    const { min, max } = plot?.scales["x"] ?? {};
    return !x?.length || ((min ?? 0) <= x[0]! && (max ?? 0) >= x[x.length - 1]!);
  }

  #options(labels: string[], look: Look): uPlot.Options {
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
        alpha: look.smoothing > 0 ? 0.25 : 0,
        width: 1,
        spanGaps: true,
        points: { show: false },
        value,
      };
      // What was measured once is no line.
      const points: uPlot.Series.Points = { show: ({ data }, at) => Array.from(data[at]!).filter((y) => y != null).length === 1, size: 7, fill: color };
      return [raw, { ...raw, label, alpha: 1, width: 1.6, points }];
    });
    return {
      width: Math.max(200, this.element.clientWidth),
      height: HEIGHT,
      cursor: { sync: { key: TOGETHER }, bind: { mousedown: pressed } },
      scales: {
        x: { time: false, ...(look.isLogX && { distr: 3 as const, range: exactly }) },
        y: { distr: look.isLogY ? 3 : 1 },
      },
      axes: [
        { ...axis, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : look.by === "wall" ? time(tick) : short(tick))) },
        { ...axis, size: 58, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : short(tick))) },
      ],
      legend: { markers: { width: 0 } },
      series: [{ label: look.by === "wall" ? CHARTS.time : CHARTS.step, value: (_, x) => (x === null ? "–" : look.by === "wall" ? time(x) : x.toLocaleString("en")) }, ...series],
    };
  }
}

// The first button zooms, and with Shift it moves.
function pressed(plot: uPlot, over: HTMLElement, zoom: uPlot.Cursor.MouseListener): uPlot.Cursor.MouseListener {
  return (event) => {
    if (event.button !== 0 || event.target !== over) return null;
    return event.shiftKey ? move(plot, event) : zoom(event);
  };
}

// Moves what all charts show with the pointer, until it is let go.
function move(plot: uPlot, from: MouseEvent): null {
  const { min, max, distr } = plot.scales["x"] ?? {};
  if (min == null || max == null) return null;
  const [into, back] = distr === 3 ? [Math.log10, (x: number) => 10 ** x] : [Number, Number];
  const [least, most] = [into(min), into(max)];
  const drag = ({ clientX }: MouseEvent) => {
    const by = ((from.clientX - clientX) / plot.over.clientWidth) * (most - least);
    for (const one of uPlot.sync(TOGETHER).plots) one.setScale("x", { min: back(least + by), max: back(most + by) });
  };
  addEventListener("mousemove", drag);
  addEventListener("mouseup", () => removeEventListener("mousemove", drag), { once: true });
  return null;
}

// As far as was asked for, where uPlot would go on to whole powers of ten.
function exactly(_: uPlot, min: number | null, max: number | null): uPlot.Range.MinMax {
  return min !== null && max !== null && min === max ? uPlot.rangeLog(min, max, 10, true) : [min, max];
}

const scheme = matchMedia("(prefers-color-scheme: dark)");

// Where it was measured, as it is, and smoothed; what has no logarithm is left out of a logarithmic axis.
function points({ columns }: Course, name: string, look: Look): [number[], (number | null)[], (number | null)[]] {
  const all = columns[look.by] ?? [];
  const values = columns[name] ?? [];
  const x: number[] = [];
  const y: number[] = [];
  all.forEach((at, i) => {
    const value = values[i];
    if (typeof at !== "number" || typeof value !== "number") return;
    if ((look.isLogX && at <= 0) || (look.isLogY && value <= 0) || at === x[x.length - 1]) return;
    x.push(at);
    y.push(value);
  });
  return [x, y, smoothed(y, look.smoothing)];
}

function short(value: number): string {
  const size = Math.abs(value);
  if (size >= 1e6) return `${value / 1e6}M`;
  if (size >= 1e4) return `${value / 1e3}k`;
  return String(Number(value.toPrecision(6)));
}

function time(seconds: number): string {
  if (seconds < 100) return `${Number(seconds.toFixed(1))} s`;
  const minutes = seconds / 60;
  return minutes < 100 ? `${Number(minutes.toFixed(1))} min` : `${Number((minutes / 60).toFixed(1))} h`;
}
