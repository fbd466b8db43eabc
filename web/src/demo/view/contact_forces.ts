// Contact forces on the object: arrows that end at the contact points, proportional to the force.

import { Group, MeshBasicMaterial, Vector3 } from "three";
import type { Colors } from "./colors";
import { SolidSegments, unitCone, unitCylinder } from "./solid_segments";

// Numbers per contact: point, force.
const CONTACT_SIZE = 6;
// Arrow length per force (m/N).
const SCALE = 0.02;
const MAX_CONTACTS = 256;
// Radius of the shaft, radius and length of the head (m). Short arrows consist of a smaller head.
const SHAFT_RADIUS = 0.0035;
const HEAD_RADIUS = 0.009;
const HEAD_LENGTH = 0.024;

export class ContactForces {
  readonly group = new Group();
  // Drawn over the fingers, in which the arrows start.
  readonly #material = new MeshBasicMaterial({ depthTest: false });
  readonly #shafts = new SolidSegments(unitCylinder(), this.#material, MAX_CONTACTS);
  readonly #heads = new SolidSegments(unitCone(), this.#material, MAX_CONTACTS);
  readonly #tip = new Vector3();
  readonly #tail = new Vector3();
  readonly #neck = new Vector3();

  constructor() {
    for (const { mesh } of [this.#shafts, this.#heads]) {
      mesh.renderOrder = 2;
      this.group.add(mesh);
    }
    this.group.visible = false;
  }

  show(contacts: Float32Array): void {
    const count = Math.min(MAX_CONTACTS, contacts.length / CONTACT_SIZE);
    for (let k = 0; k < count; k++) {
      this.#tip.fromArray(contacts, CONTACT_SIZE * k);
      // Against the force: the arrow comes from the side of the finger.
      this.#tail.fromArray(contacts, CONTACT_SIZE * k + 3).multiplyScalar(-SCALE).add(this.#tip);
      const length = this.#tip.distanceTo(this.#tail);
      const head = Math.min(HEAD_LENGTH, length);
      this.#neck.lerpVectors(this.#tip, this.#tail, length > 0 ? head / length : 0);
      this.#shafts.set(k, this.#tail, this.#neck, SHAFT_RADIUS);
      this.#heads.set(k, this.#neck, this.#tip, (HEAD_RADIUS * head) / HEAD_LENGTH);
    }
    this.#shafts.count = this.#heads.count = count;
  }

  setColors(colors: Colors): void {
    this.#material.color = colors.force;
  }
}
