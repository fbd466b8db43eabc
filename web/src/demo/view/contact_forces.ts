// Contact forces on the object: lines from the contact points, proportional to the force.

import { BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments } from "three";
import type { Colors } from "./colors";

// Numbers per contact: point, force.
const CONTACT_SIZE = 6;
// Line length per force (m/N).
const SCALE = 0.012;
const MAX_CONTACTS = 256;

export class ContactForces {
  readonly lines: LineSegments;
  readonly #ends = new BufferAttribute(new Float32Array(2 * 3 * MAX_CONTACTS), 3);
  readonly #material = new LineBasicMaterial({ depthTest: false });

  constructor() {
    const geometry = new BufferGeometry().setAttribute("position", this.#ends);
    this.lines = new LineSegments(geometry, this.#material);
    this.lines.frustumCulled = false;
    this.lines.renderOrder = 2;
    this.lines.visible = false;
  }

  show(contacts: Float32Array): void {
    const count = Math.min(MAX_CONTACTS, contacts.length / CONTACT_SIZE);
    for (let k = 0; k < count; k++) {
      const [x, y, z, fx, fy, fz] = contacts.subarray(CONTACT_SIZE * k, CONTACT_SIZE * (k + 1)) as unknown as number[];
      this.#ends.setXYZ(2 * k, x!, y!, z!);
      // Against the force: the line points to the side of the finger.
      this.#ends.setXYZ(2 * k + 1, x! - SCALE * fx!, y! - SCALE * fy!, z! - SCALE * fz!);
    }
    this.#ends.needsUpdate = true;
    this.lines.geometry.setDrawRange(0, 2 * count);
  }

  setColors(colors: Colors): void {
    this.#material.color = colors.force;
  }
}
