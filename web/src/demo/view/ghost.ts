// Ghost of the robot at the commanded joint positions, visible through other geometry. Fingers that press on
// the object are commanded to positions inside it.

import { Group, Mesh, MeshBasicMaterial } from "three";
import type { Frame } from "../worker/protocol";
import type { Colors } from "./colors";
import { PoseInterpolator } from "./pose_interpolation";

export class Ghost {
  readonly group = new Group();
  readonly #material = new MeshBasicMaterial({ transparent: true, opacity: 0.35, depthTest: false, depthWrite: false });
  readonly #interpolator = new PoseInterpolator();
  #bodies: Group[] = [];

  constructor() {
    this.group.visible = false;
  }

  // Clones the bodies; their geometries are shared.
  show(robot: readonly Group[]): void {
    this.#bodies = robot.map((body) => body.clone());
    for (const part of this.#bodies.flatMap((body) => body.children)) {
      part.castShadow = part.receiveShadow = false;
      if (part instanceof Mesh) part.material = this.#material;
    }
    this.group.clear();
    this.group.add(...this.#bodies);
  }

  showFrame({ commandedPoses, running }: Frame, now: number): void {
    if (running) this.#interpolator.moveTo(commandedPoses, now);
    else this.#interpolator.jumpTo(commandedPoses, now);
  }

  // Returns whether the motion is unfinished.
  apply(now: number): boolean {
    return this.group.visible && this.#interpolator.apply(this.#bodies, now);
  }

  setColors(colors: Colors): void {
    this.#material.color = colors.target;
  }
}
