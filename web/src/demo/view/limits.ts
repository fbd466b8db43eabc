// Joints near the end of their way: what they move is seen through all that stands before it.

import { type Group, Mesh, MeshBasicMaterial } from "three";
import type { Frame, Joint } from "../protocol";
import type { Colors } from "./colors";

// Nearer to a limit than this share of the way is worth seeing.
const NEAR = 0.03;

export function isNearLimit(q: number, { lower, upper }: Joint): boolean {
  const share = (q - lower) / (upper - lower);
  return share < NEAR || share > 1 - NEAR;
}

export class Limits {
  readonly #skin = new MeshBasicMaterial({ transparent: true, opacity: 0.6, depthTest: false, depthWrite: false });
  #joints: readonly Joint[] = [];
  // What each joint moves, once more over itself.
  #parts: Mesh[][] = [];
  #isOn = false;
  #frame: Frame | null = null;

  show(robot: readonly Group[], joints: readonly Joint[]): void {
    this.#joints = joints;
    this.#parts = joints.map(({ body }) => {
      const parts = (robot[body]?.children ?? []).filter((part) => part instanceof Mesh);
      const over = parts.map(({ geometry }) => new Mesh(geometry, this.#skin));
      for (const part of over) part.visible = false;
      if (over.length > 0) robot[body]?.add(...over);
      return over;
    });
  }

  follow(frame: Frame): void {
    this.#frame = frame;
    this.#joints.forEach((joint, i) => {
      const isSeen = this.#isOn && isNearLimit(frame.joints[i]!, joint);
      for (const part of this.#parts[i]!) part.visible = isSeen;
    });
  }

  set on(on: boolean) {
    this.#isOn = on;
    if (this.#frame) this.follow(this.#frame);
  }

  paint(colors: Colors): void {
    this.#skin.color = colors.accent;
  }
}
