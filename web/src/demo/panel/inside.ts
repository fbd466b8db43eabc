// What goes on inside: where every joint stands between its limits, and what the fabric keeps.

import { element, h, svg } from "../../common/dom";
import type { Frame, Joint, Terms, ToWorker } from "../protocol";
import { INSIDE } from "../strings";

// In the order of Ready: the arm, then finger by finger.
const GROUPS: [string, number][] = [
  [INSIDE.groups.arm, 7],
  [INSIDE.groups.index, 4],
  [INSIDE.groups.middle, 4],
  [INSIDE.groups.ring, 4],
  [INSIDE.groups.thumb, 4],
];
// Nearer to a limit than this share of the way is worth seeing.
const NEAR = 0.03;

const PLOTS: (keyof Terms)[] = ["energy", "damping", "margin"];

export class InsidePanel {
  readonly #box = element("inside", HTMLDetailsElement);
  readonly #marks: HTMLElement[] = [];
  readonly #joints: Joint[] = [];
  readonly #plots = new Map<keyof Terms, { line: SVGPolylineElement; value: HTMLElement }>();
  #course: (Terms | null)[] = [];
  readonly #send: (message: ToWorker) => void;

  constructor(send: (message: ToWorker) => void) {
    this.#send = send;
    this.#box.addEventListener("toggle", () => this.ask());
    const plots = element("plots", HTMLElement);
    for (const key of PLOTS) {
      const { name, unit } = INSIDE.plots[key];
      const line = svg("polyline");
      const frame = { viewBox: "0 0 100 30", preserveAspectRatio: "none", "aria-hidden": "true" };
      const value = h("span", { class: "is-number" });
      plots.append(h("figure", {}, h("figcaption", {}, name, " ", value, ` ${unit}`), svg("svg", frame, line)));
      this.#plots.set(key, { line, value });
    }
  }

  // Says whether the terms are wanted.
  ask(): void {
    this.#send({ kind: "watch", on: this.#box.open });
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

  show({ joints, terms, tick, ticks }: Frame): void {
    if (!this.#box.open) return;
    joints.forEach((q, i) => {
      const { lower, upper } = this.#joints[i]!;
      const share = (q - lower) / (upper - lower);
      const mark = this.#marks[i]!;
      mark.style.left = `${100 * Math.min(1, Math.max(0, share))}%`;
      mark.classList.toggle("is-near", share < NEAR || share > 1 - NEAR);
      const bar = mark.parentElement!;
      const text = INSIDE.stands(q.toFixed(2), lower.toFixed(2), upper.toFixed(2));
      if (bar.ariaValueText !== text) [bar.ariaValueNow, bar.ariaValueText] = [q.toFixed(2), text];
    });
    if (ticks + 1 < this.#course.length) this.#course.length = 0;
    this.#course[tick] = terms;
    for (const [key, { line, value }] of this.#plots) {
      const now = terms?.[key];
      value.textContent = typeof now === "number" ? now.toPrecision(3) : "–";
      line.setAttribute("points", points(this.#course, key, ticks));
    }
  }
}

// From the first tick to the last, the greatest value at the top.
function points(course: (Terms | null)[], key: keyof Terms, ticks: number): string {
  const known: [number, number][] = [];
  course.forEach((terms, tick) => {
    const value = terms?.[key];
    if (typeof value === "number" && Number.isFinite(value)) known.push([tick, value]);
  });
  const most = Math.max(1e-9, ...known.map(([, value]) => value));
  return known.map(([tick, value]) => `${((100 * tick) / Math.max(1, ticks)).toFixed(2)},${(29 - (28 * value) / most).toFixed(2)}`).join(" ");
}
