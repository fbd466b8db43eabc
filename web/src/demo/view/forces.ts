// What presses on the object: a line from where it presses, as long as it is strong.

import { BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments } from "three";
import type { Colors } from "./colors";

// Six numbers a contact: where, and with what force.
const NUMBERS = 6;
// Metres a newton.
const SCALE = 0.012;
const MOST = 256;

export class Forces {
  readonly lines: LineSegments;
  readonly #ends = new BufferAttribute(new Float32Array(2 * 3 * MOST), 3);
  readonly #material = new LineBasicMaterial({ depthTest: false });

  constructor() {
    const geometry = new BufferGeometry().setAttribute("position", this.#ends);
    this.lines = new LineSegments(geometry, this.#material);
    this.lines.frustumCulled = false;
    this.lines.renderOrder = 2;
    this.lines.visible = false;
  }

  show(contacts: Float32Array): void {
    const count = Math.min(MOST, contacts.length / NUMBERS);
    for (let k = 0; k < count; k++) {
      const [x, y, z, fx, fy, fz] = contacts.subarray(NUMBERS * k, NUMBERS * (k + 1)) as unknown as number[];
      this.#ends.setXYZ(2 * k, x!, y!, z!);
      // Backwards: a finger is on the side that the force comes from.
      this.#ends.setXYZ(2 * k + 1, x! - SCALE * fx!, y! - SCALE * fy!, z! - SCALE * fz!);
    }
    this.#ends.needsUpdate = true;
    this.lines.geometry.setDrawRange(0, 2 * count);
  }

  paint(colors: Colors): void {
    this.#material.color = colors.force;
  }
}
