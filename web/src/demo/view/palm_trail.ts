// Trajectory of the palm during an attempt, as a tube.

import { MeshBasicMaterial, Vector3 } from "three";
import type { Frame } from "../worker/protocol";
import type { Colors } from "./colors";
import { SolidSegments, unitCylinder } from "./solid_segments";

// Index of the palm's body; numbers per pose.
const PALM = 7;
const POSE_SIZE = 7;
// Capacity in ticks; an attempt is shorter.
const MAX_TICKS = 4096;
// Radius of the tube (m).
const RADIUS = 0.004;

export class PalmTrail {
  readonly #material = new MeshBasicMaterial();
  readonly #tube = new SolidSegments(unitCylinder(), this.#material, MAX_TICKS);
  readonly mesh = this.#tube.mesh;
  // Positions of the palm by tick.
  readonly #points: Vector3[] = [];

  constructor() {
    this.mesh.visible = false;
  }

  show({ poses, tick, ticks }: Frame): void {
    // A new attempt has started.
    if (ticks + 1 < this.#points.length) this.#points.length = 0;
    // Ticks without a frame get the position of the next frame.
    for (let k = this.#points.length; k <= tick; k++) {
      const point = new Vector3().fromArray(poses, PALM * POSE_SIZE);
      if (k > 0) this.#tube.set(k - 1, this.#points[k - 1]!, point, RADIUS);
      this.#points.push(point);
    }
    // The last of `tick + 1` points ends segment `tick - 1`.
    this.#tube.count = tick;
  }

  setColors(colors: Colors): void {
    this.#material.color = colors.accent;
  }
}
