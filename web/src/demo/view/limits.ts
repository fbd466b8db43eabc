// Joints near the end of their way: what they move glows.

import { Color, type Group, Mesh, MeshStandardMaterial } from "three";
import type { Frame, Joint } from "../protocol";
import type { Colors } from "./colors";

// Nearer to a limit than this share of the way is worth seeing.
const NEAR = 0.03;
const DARK = new Color(0);

export function isNearLimit(q: number, { lower, upper }: Joint): boolean {
  const share = (q - lower) / (upper - lower);
  return share < NEAR || share > 1 - NEAR;
}

export class Limits {
  #joints: readonly Joint[] = [];
  // What each joint is shown by: the body that it moves.
  #skins: MeshStandardMaterial[][] = [];
  #color = DARK;
  #isOn = false;
  #frame: Frame | null = null;

  show(robot: readonly Group[], joints: readonly Joint[]): void {
    this.#joints = joints;
    const skins = (body: Group | undefined) =>
      (body?.children ?? []).flatMap((part) => (part instanceof Mesh && part.material instanceof MeshStandardMaterial ? [part.material] : []));
    this.#skins = joints.map(({ body }) => skins(robot[body]));
  }

  follow(frame: Frame): void {
    this.#frame = frame;
    this.#joints.forEach((joint, i) => {
      const glows = this.#isOn && isNearLimit(frame.joints[i]!, joint);
      for (const skin of this.#skins[i]!) skin.emissive = glows ? this.#color : DARK;
    });
  }

  set on(on: boolean) {
    this.#isOn = on;
    if (this.#frame) this.follow(this.#frame);
  }

  paint(colors: Colors): void {
    this.#color = colors.accent;
    if (this.#frame) this.follow(this.#frame);
  }
}
