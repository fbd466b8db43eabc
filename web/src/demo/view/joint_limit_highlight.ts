// Highlights links whose joint is near a limit, visible through other geometry.

import { type Group, Mesh, MeshBasicMaterial } from "three";
import type { Frame, Joint } from "../worker/protocol";
import type { Colors } from "./colors";

// Distance from a limit that counts as near, as a fraction of the joint's range.
const NEAR_FRACTION = 0.03;

export function isNearLimit(q: number, { lower, upper }: Joint): boolean {
  const fraction = (q - lower) / (upper - lower);
  return fraction < NEAR_FRACTION || fraction > 1 - NEAR_FRACTION;
}

export class JointLimitHighlight {
  readonly #material = new MeshBasicMaterial({ transparent: true, opacity: 0.6, depthTest: false, depthWrite: false });
  #joints: readonly Joint[] = [];
  // Overlay copies of the meshes that each joint moves.
  #overlays: Mesh[][] = [];
  #isVisible = false;
  #frame: Frame | null = null;

  show(robot: readonly Group[], joints: readonly Joint[]): void {
    this.#joints = joints;
    this.#overlays = joints.map(({ body }) => {
      const parts = (robot[body]?.children ?? []).filter((part) => part instanceof Mesh);
      const overlays = parts.map(({ geometry }) => new Mesh(geometry, this.#material));
      for (const overlay of overlays) overlay.visible = false;
      if (overlays.length > 0) robot[body]?.add(...overlays);
      return overlays;
    });
  }

  showFrame(frame: Frame): void {
    this.#frame = frame;
    this.#joints.forEach((joint, i) => {
      const isHighlighted = this.#isVisible && isNearLimit(frame.joints[i]!, joint);
      for (const overlay of this.#overlays[i]!) overlay.visible = isHighlighted;
    });
  }

  set isVisible(on: boolean) {
    this.#isVisible = on;
    if (this.#frame) this.showFrame(this.#frame);
  }

  setColors(colors: Colors): void {
    this.#material.color = colors.accent;
  }
}
