// What goes on inside: where every joint stands between its limits, and what the fabric keeps.

import { element, h, svg } from "../../common/dom";
import type { Course, Frame, Joint, Moment, ToWorker } from "../protocol";
import { INSIDE } from "../strings";
import { isNearLimit } from "../view/limits";

// In the order of Ready: the arm, then finger by finger.
const GROUPS: [string, number][] = [
  [INSIDE.groups.arm, 7],
  [INSIDE.groups.index, 4],
  [INSIDE.groups.middle, 4],
  [INSIDE.groups.ring, 4],
  [INSIDE.groups.thumb, 4],
];

// A plot of one or several quantities over the attempt; of several, each has its name.
interface Plot {
  of: [string, (moment: Moment) => number | null | undefined][];
  lines: SVGPolylineElement[];
  values: HTMLElement[];
}

export class InsidePanel {
  readonly #box = element("inside", HTMLDetailsElement);
  readonly #marks: HTMLElement[] = [];
  readonly #joints: Joint[] = [];
  readonly #plots: Plot[];
  #course: (Moment | null)[] = [];
  readonly #send: (message: ToWorker) => void;

  constructor(send: (message: ToWorker) => void) {
    this.#send = send;
    this.#box.addEventListener("toggle", () => this.ask());
    const { energy, terms, damping, margin } = INSIDE.plots;
    this.#plots = [
      plot(energy, [["", (moment) => moment.energy]]),
      plot(terms, [
        [terms.potential, (moment) => moment.terms?.potential],
        [terms.damping, (moment) => moment.terms?.damping],
        [terms.geometry, (moment) => moment.terms?.geometry],
        [terms.energization, (moment) => moment.terms?.energization],
      ]),
      plot(damping, [["", (moment) => moment.damping]]),
      plot(margin, [["", (moment) => moment.margin]]),
    ];
  }

  // Says whether the moments are wanted.
  ask(): void {
    this.#send({ kind: "watch", on: this.#box.open });
  }

  // An attempt has ended: what came between two pictures is plotted, too.
  end(): void {
    if (this.#box.open) this.ask();
  }

  // What was before anybody looked, and between.
  showCourse({ moments }: Course): void {
    this.#course = moments;
  }

  limit(joints: Joint[]): void {
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
    // A finger that taps it focuses it, which shows its text.
    return h("div", { class: "joint", role: "meter", tabindex: -1, "aria-label": name, ...range }, mark);
  }

  show({ joints, moment, tick, ticks }: Frame): void {
    if (!this.#box.open) return;
    joints.forEach((q, i) => {
      const joint = this.#joints[i]!;
      const { lower, upper } = joint;
      const share = (q - lower) / (upper - lower);
      const mark = this.#marks[i]!;
      mark.style.left = `${100 * Math.min(1, Math.max(0, share))}%`;
      mark.classList.toggle("is-near", isNearLimit(q, joint));
      const bar = mark.parentElement!;
      const text = INSIDE.stands(q.toFixed(2), lower.toFixed(2), upper.toFixed(2));
      if (bar.ariaValueText !== text) [bar.ariaValueNow, bar.ariaValueText] = [q.toFixed(2), text];
    });
    if (ticks + 1 < this.#course.length) this.#course.length = 0;
    this.#course[tick] = moment;
    for (const plot of this.#plots) this.#draw(plot, moment, ticks);
  }

  // From the first tick to the last, the greatest value of all its lines at the top.
  #draw({ of, lines, values }: Plot, moment: Moment | null, ticks: number): void {
    const known = of.map(([, value]) => {
      const points: [number, number][] = [];
      this.#course.forEach((moment, tick) => {
        const y = moment && value(moment);
        if (typeof y === "number" && Number.isFinite(y)) points.push([tick, y]);
      });
      return points;
    });
    const most = Math.max(1e-9, ...known.flat().map(([, y]) => y));
    const at = ([tick, y]: [number, number]) => `${((100 * tick) / Math.max(1, ticks)).toFixed(2)},${(29 - (28 * y) / most).toFixed(2)}`;
    known.forEach((points, i) => {
      lines[i]!.setAttribute("points", points.map(at).join(" "));
      const now = moment && of[i]![1](moment);
      values[i]!.textContent = typeof now === "number" ? now.toPrecision(3) : "–";
    });
  }
}

function plot({ name, unit }: { name: string; unit: string }, of: Plot["of"]): Plot {
  const lines = of.map(() => svg("polyline"));
  const values = of.map(() => h("span", { class: "is-number" }));
  const named = of.map(([own], i) => h("span", { class: own ? "series" : null }, own, " ", values[i]!));
  const frame = { viewBox: "0 0 100 30", preserveAspectRatio: "none", "aria-hidden": "true" };
  const caption = h("figcaption", {}, name, of.length > 1 ? ` (${unit})` : "", " ", ...named, of.length > 1 ? "" : ` ${unit}`);
  element("plots", HTMLElement).append(h("figure", {}, caption, svg("svg", frame, ...lines)));
  return { of, lines, values };
}
