// Where the objects of a row of attempts stood, seen from above with the robot at the head, as the arrow keys have it:
// which were lifted, which not, and how each was turned. A click on one shows its attempt again.

import { element, svg } from "../../common/dom";
import type { Attempted, Rectangle } from "../protocol";
import { BATCH } from "../strings";

// Half the line that shows how an object was turned, how near a click has to be, and room around the workspace (cm).
const REACH = 1.4;
const HIT = 1.8;
const MARGIN = 2;

export class Places {
  readonly #figure = element("places", HTMLElement);
  readonly #map = element("places-map", SVGSVGElement);
  readonly #replay: (seed: number) => void;

  constructor(replay: (seed: number) => void) {
    this.#replay = replay;
  }

  limit({ x, y }: Rectangle): void {
    const [left, top] = [100 * y[0], 100 * x[0]];
    const [width, height] = [100 * y[1] - left, 100 * x[1] - top];
    const box = [left - MARGIN, top - MARGIN, width + 2 * MARGIN, height + 2 * MARGIN];
    this.#map.setAttribute("viewBox", box.join(" "));
    this.#map.replaceChildren(svg("rect", { x: left, y: top, width, height }));
  }

  add({ seed, pose, lifted, words }: Attempted): void {
    this.#figure.hidden = false;
    const [cx, cy] = [100 * pose.y, 100 * pose.x];
    const [dx, dy] = [REACH * Math.sin(pose.yaw), REACH * Math.cos(pose.yaw)];
    const mark = svg(
      "g",
      { class: lifted ? "is-lifted" : "is-failed" },
      svg("title", {}, BATCH.ended(seed, words)),
      svg("circle", { class: "hit", cx, cy, r: HIT }),
      svg("line", { x1: cx - dx, y1: cy - dy, x2: cx + dx, y2: cy + dy }),
      svg("circle", { cx, cy, r: lifted ? 0.5 : 0.9 }),
    );
    mark.addEventListener("click", () => this.#replay(seed));
    this.#map.append(mark);
  }

  clear(): void {
    this.#figure.hidden = true;
    for (const mark of this.#map.querySelectorAll("g")) mark.remove();
  }
}
