// Trajectory of the palm during an attempt.

import { BufferAttribute, BufferGeometry, Line, LineBasicMaterial } from "three";
import type { Frame } from "../worker/protocol";
import type { Colors } from "./colors";

// Index of the palm's body; numbers per pose.
const PALM = 7;
const POSE_SIZE = 7;
// Capacity in ticks; an attempt is shorter.
const MAX_TICKS = 4096;

export class PalmTrail {
  readonly line: Line;
  readonly #points = new BufferAttribute(new Float32Array(3 * MAX_TICKS), 3);
  readonly #material = new LineBasicMaterial();
  #length = 0;

  constructor() {
    const geometry = new BufferGeometry().setAttribute("position", this.#points);
    this.line = new Line(geometry, this.#material);
    this.line.frustumCulled = false;
    this.line.visible = false;
    geometry.setDrawRange(0, 0);
  }

  show({ poses, tick, ticks }: Frame): void {
    // A new attempt has started.
    if (ticks < this.#length) this.#length = 0;
    const offset = PALM * POSE_SIZE;
    // Ticks without a frame get the position of the next frame.
    for (let k = this.#length; k <= Math.min(tick, MAX_TICKS - 1); k++) {
      this.#points.setXYZ(k, poses[offset]!, poses[offset + 1]!, poses[offset + 2]!);
    }
    this.#length = Math.max(this.#length, tick + 1);
    this.#points.needsUpdate = true;
    this.line.geometry.setDrawRange(0, Math.min(tick + 1, MAX_TICKS));
  }

  setColors(colors: Colors): void {
    this.#material.color = colors.accent;
  }
}
