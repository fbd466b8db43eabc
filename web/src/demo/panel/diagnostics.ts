// Policy internals: joint positions within their limits, and plots of energy, acceleration terms, damping and
// margin.

import { element, h, svg } from "../../common/dom";
import type { EventBus } from "../app/event_bus";
import { DIAGNOSTICS } from "../app/strings";
import { isNearLimit } from "../view/joint_limit_highlight";
import type { WorkerRequest } from "../worker/messages";
import type { Frame, Joint, TelemetrySample } from "../worker/protocol";

// Joint groups in the order of `Ready`, with their numbers of joints.
const GROUPS: [string, number][] = [
  [DIAGNOSTICS.groups.arm, 7],
  [DIAGNOSTICS.groups.index, 4],
  [DIAGNOSTICS.groups.middle, 4],
  [DIAGNOSTICS.groups.ring, 4],
  [DIAGNOSTICS.groups.thumb, 4],
];

// Plot of one or more named series over the attempt; a single series has no name.
interface Plot {
  series: [string, (sample: TelemetrySample) => number | null | undefined][];
  lines: SVGPolylineElement[];
  values: HTMLElement[];
  // Labels of the axes: maximum value, last time.
  max: HTMLElement;
  end: HTMLElement;
}

// Control period (s).
const TICK_S = 1 / 30;

export class DiagnosticsPanel {
  readonly #details = element("diagnostics", HTMLDetailsElement);
  readonly #marks: HTMLElement[] = [];
  readonly #joints: Joint[] = [];
  readonly #plots: Plot[];
  // Telemetry by tick.
  #samples: (TelemetrySample | null)[] = [];
  readonly #send: (request: WorkerRequest) => void;

  constructor(bus: EventBus, send: (request: WorkerRequest) => void) {
    this.#send = send;
    this.#details.addEventListener("toggle", () => {
      this.requestTelemetry();
      if (this.#details.open) this.#details.scrollIntoView({ block: "start" });
    });
    const { energy, terms, damping, margin } = DIAGNOSTICS.plots;
    this.#plots = [
      plot(energy, [["", (sample) => sample.energy]]),
      plot(terms, [
        [terms.potential, (sample) => sample.terms?.potential],
        [terms.damping, (sample) => sample.terms?.damping],
        [terms.geometry, (sample) => sample.terms?.geometry],
        [terms.energization, (sample) => sample.terms?.energization],
      ]),
      plot(damping, [["", (sample) => sample.damping]]),
      plot(margin, [["", (sample) => sample.limitMargin]]),
    ];
    bus.on("ready", ({ joints }) => this.#setJoints(joints));
    bus.on("frame", (frame) => this.#show(frame));
    bus.on("telemetry", ({ samples }) => (this.#samples = samples));
    bus.on("outcome", () => this.#onAttemptEnd());
  }

  // Turns the telemetry stream on while the section is open. The worker then posts the samples so far.
  requestTelemetry(): void {
    this.#send({ kind: "streamTelemetry", on: this.#details.open });
  }

  // Fetches the samples of ticks between two frames.
  #onAttemptEnd(): void {
    if (this.#details.open) this.requestTelemetry();
  }

  #setJoints(joints: Joint[]): void {
    this.#joints.splice(0, Infinity, ...joints);
    this.#marks.length = 0;
    const list = element("joints", HTMLElement);
    list.replaceChildren();
    let first = 0;
    for (const [name, count] of GROUPS) {
      const bars = joints.slice(first, first + count).map((joint) => this.#bar(joint));
      list.append(h("div", { class: "joint-group" }, h("span", {}, name), h("div", {}, ...bars)));
      first += count;
    }
  }

  #bar({ name, lower, upper }: Joint): HTMLElement {
    const mark = h("i");
    this.#marks.push(mark);
    const range = { "aria-valuemin": lower.toFixed(2), "aria-valuemax": upper.toFixed(2), "aria-valuenow": lower.toFixed(2) };
    // Focusable, so that a tap shows its text.
    return h("div", { class: "joint", role: "meter", tabindex: -1, "aria-label": name, ...range }, mark);
  }

  #show({ joints, telemetry, tick, ticks }: Frame): void {
    if (!this.#details.open) return;
    joints.forEach((q, i) => {
      const joint = this.#joints[i]!;
      const { lower, upper } = joint;
      const fraction = (q - lower) / (upper - lower);
      const mark = this.#marks[i]!;
      mark.style.left = `${100 * Math.min(1, Math.max(0, fraction))}%`;
      mark.classList.toggle("is-near", isNearLimit(q, joint));
      const bar = mark.parentElement!;
      const text = DIAGNOSTICS.position(q.toFixed(2), lower.toFixed(2), upper.toFixed(2));
      if (bar.ariaValueText !== text) [bar.ariaValueNow, bar.ariaValueText] = [q.toFixed(2), text];
    });
    if (ticks + 1 < this.#samples.length) this.#samples.length = 0;
    this.#samples[tick] = telemetry;
    for (const plot of this.#plots) this.#draw(plot, telemetry, ticks);
  }

  // The x axis spans all ticks; the y axis extends from 0 to the maximum of all series.
  #draw({ series, lines, values, max: maxLabel, end }: Plot, current: TelemetrySample | null, ticks: number): void {
    const curves = series.map(([, value]) => {
      const points: [number, number][] = [];
      this.#samples.forEach((sample, tick) => {
        const y = sample && value(sample);
        if (typeof y === "number" && Number.isFinite(y)) points.push([tick, y]);
      });
      return points;
    });
    const max = Math.max(1e-9, ...curves.flat().map(([, y]) => y));
    const isEmpty = curves.every((points) => points.length === 0);
    maxLabel.textContent = isEmpty ? "" : max.toPrecision(3);
    end.textContent = isEmpty ? "" : DIAGNOSTICS.seconds((ticks * TICK_S).toFixed(1));
    const toSvg = ([tick, y]: [number, number]) => `${((100 * tick) / Math.max(1, ticks)).toFixed(2)},${(29 - (28 * y) / max).toFixed(2)}`;
    curves.forEach((points, i) => {
      lines[i]!.setAttribute("points", points.map(toSvg).join(" "));
      const now = current && series[i]![1](current);
      values[i]!.textContent = typeof now === "number" ? now.toPrecision(3) : DIAGNOSTICS.noValue;
    });
  }
}

function plot({ name, unit }: { name: string; unit: string }, series: Plot["series"]): Plot {
  const lines = series.map(() => svg("polyline"));
  const values = series.map(() => h("span", { class: "is-number" }));
  const legend = series.map(([label], i) => h("span", { class: label ? "series" : null }, label, " ", values[i]!));
  const frame = { viewBox: "0 0 100 30", preserveAspectRatio: "none", "aria-hidden": "true" };
  const hasLegend = series.length > 1;
  const caption = h("figcaption", {}, name, hasLegend ? ` (${unit})` : "", " ", ...legend, hasLegend ? "" : ` ${unit}`);
  const [max, end] = [h("span", { class: "axis-max" }), h("span")];
  const axis = h("div", { class: "axis", "aria-hidden": "true" }, h("span", {}, "0"), end);
  element("plots", HTMLElement).append(h("figure", {}, caption, max, svg("svg", frame, ...lines), axis));
  return { series, lines, values, max, end };
}
