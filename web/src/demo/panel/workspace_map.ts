// Map of the workspace for a batch: top view with the robot at the top, matching the arrow keys. One mark per
// attempt shows object pose and outcome; a click replays the attempt.

import { element, svg } from "../../common/dom";
import { BATCH } from "../app/strings";
import type { BatchAttempt, Rectangle } from "../worker/protocol";
import { insertBySeed } from "./seed_order";

// Half length of the yaw line, radius of the click target, margin around the workspace (cm).
const HALF_LINE = 1.4;
const HIT_RADIUS = 1.8;
const MARGIN = 2;

export class WorkspaceMap {
  readonly #figure = element("workspace-map", HTMLElement);
  readonly #svg = element("workspace-map-svg", SVGSVGElement);
  readonly #replay: (seed: number) => void;

  constructor(replay: (seed: number) => void) {
    this.#replay = replay;
  }

  setWorkspace({ x, y }: Rectangle): void {
    const [left, top] = [100 * y[0], 100 * x[0]];
    const [width, height] = [100 * y[1] - left, 100 * x[1] - top];
    const box = [left - MARGIN, top - MARGIN, width + 2 * MARGIN, height + 2 * MARGIN];
    this.#svg.setAttribute("viewBox", box.join(" "));
    this.#svg.replaceChildren(svg("rect", { x: left, y: top, width, height }));
  }

  add({ seed, pose, lifted, text }: BatchAttempt): void {
    this.#figure.hidden = false;
    const [cx, cy] = [100 * pose.y, 100 * pose.x];
    const [dx, dy] = [HALF_LINE * Math.sin(pose.yaw), HALF_LINE * Math.cos(pose.yaw)];
    const mark = svg(
      "g",
      { class: lifted ? "is-lifted" : "is-failed" },
      svg("title", {}, BATCH.outcome(seed, text)),
      svg("circle", { class: "hit", cx, cy, r: HIT_RADIUS }),
      svg("line", { x1: cx - dx, y1: cy - dy, x2: cx + dx, y2: cy + dy }),
      svg("circle", { cx, cy, r: lifted ? 0.5 : 0.9 }),
    );
    mark.addEventListener("click", () => this.#replay(seed));
    insertBySeed(this.#svg, mark, seed);
  }

  clear(): void {
    this.#figure.hidden = true;
    for (const mark of this.#svg.querySelectorAll("g")) mark.remove();
  }
}
