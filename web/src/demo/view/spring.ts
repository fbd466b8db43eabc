// The spring by which somebody pulls at the object.

import { BufferAttribute, BufferGeometry, type Group, Line, LineBasicMaterial, Vector3 } from "three";
import type { Pull } from "../protocol";
import type { Colors } from "./colors";

export class Spring {
  readonly line: Line;
  readonly #ends = new BufferAttribute(new Float32Array(6), 3);
  readonly #material = new LineBasicMaterial({ depthTest: false });
  readonly #at = new Vector3();
  #pull: Pull | null = null;

  constructor() {
    this.line = new Line(new BufferGeometry().setAttribute("position", this.#ends), this.#material);
    this.line.frustumCulled = false;
    this.line.renderOrder = 2;
    this.line.visible = false;
  }

  set(pull: Pull | null): void {
    this.#pull = pull;
    this.line.visible = pull !== null;
  }

  // From where the object is now.
  follow(object: Group): void {
    if (!this.#pull) return;
    object.updateMatrixWorld();
    this.#at.set(...this.#pull.point).applyMatrix4(object.matrixWorld);
    this.#ends.setXYZ(0, this.#at.x, this.#at.y, this.#at.z);
    this.#ends.setXYZ(1, ...this.#pull.towards);
    this.#ends.needsUpdate = true;
  }

  paint(colors: Colors): void {
    this.#material.color = colors.ink;
  }
}
