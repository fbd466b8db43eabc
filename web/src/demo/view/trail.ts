// What an attempt leaves behind: the palm's path.

import { BufferAttribute, BufferGeometry, Line, LineBasicMaterial } from "three";
import type { Frame } from "../protocol";
import type { Colors } from "./colors";

// The body that carries the palm; seven numbers a body.
const PALM = 7;
const NUMBERS = 7;
// Ticks that fit; an attempt is shorter.
const MOST_TICKS = 4096;

// Where the palm has been.
export class Trail {
  readonly line: Line;
  readonly #points = new BufferAttribute(new Float32Array(3 * MOST_TICKS), 3);
  readonly #material = new LineBasicMaterial();
  #known = 0;

  constructor() {
    const geometry = new BufferGeometry().setAttribute("position", this.#points);
    this.line = new Line(geometry, this.#material);
    this.line.frustumCulled = false;
    this.line.visible = false;
    geometry.setDrawRange(0, 0);
  }

  show({ poses, tick, ticks }: Frame): void {
    // Another attempt.
    if (ticks < this.#known) this.#known = 0;
    const at = PALM * NUMBERS;
    // Ticks that no frame was made for lie on the way from the last one.
    for (let k = this.#known; k <= Math.min(tick, MOST_TICKS - 1); k++) {
      this.#points.setXYZ(k, poses[at]!, poses[at + 1]!, poses[at + 2]!);
    }
    this.#known = Math.max(this.#known, tick + 1);
    this.#points.needsUpdate = true;
    this.line.geometry.setDrawRange(0, Math.min(tick + 1, MOST_TICKS));
  }

  paint(colors: Colors): void {
    this.#material.color = colors.accent;
  }
}
