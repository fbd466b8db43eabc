// Line of the spring with which the user pulls the object.

import { BufferAttribute, BufferGeometry, type Group, Line, LineBasicMaterial, Vector3 } from "three";
import type { Drag } from "../worker/protocol";
import type { Colors } from "./colors";

export class DragSpring {
  readonly line: Line;
  readonly #ends = new BufferAttribute(new Float32Array(6), 3);
  readonly #material = new LineBasicMaterial({ depthTest: false });
  readonly #attachment = new Vector3();
  #drag: Drag | null = null;

  constructor() {
    this.line = new Line(new BufferGeometry().setAttribute("position", this.#ends), this.#material);
    this.line.frustumCulled = false;
    this.line.renderOrder = 2;
    this.line.visible = false;
  }

  set(drag: Drag | null): void {
    this.#drag = drag;
    this.line.visible = drag !== null;
  }

  // Updates the line for the current pose of the object.
  follow(object: Group): void {
    if (!this.#drag) return;
    object.updateMatrixWorld();
    this.#attachment.set(...this.#drag.point).applyMatrix4(object.matrixWorld);
    this.#ends.setXYZ(0, this.#attachment.x, this.#attachment.y, this.#attachment.z);
    this.#ends.setXYZ(1, ...this.#drag.target);
    this.#ends.needsUpdate = true;
  }

  setColors(colors: Colors): void {
    this.#material.color = colors.ink;
  }
}
