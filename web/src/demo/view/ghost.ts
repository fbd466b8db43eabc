// Where the commands would have the robot, through all that stands before it: fingers that are stopped by the object are
// commanded to be inside, and press.

import { Group, Mesh, MeshBasicMaterial } from "three";
import type { Frame } from "../protocol";
import type { Colors } from "./colors";
import { Motion } from "./motion";

export class Ghost {
  readonly group = new Group();
  readonly #skin = new MeshBasicMaterial({ transparent: true, opacity: 0.35, depthTest: false, depthWrite: false });
  readonly #motion = new Motion();
  #bodies: Group[] = [];

  constructor() {
    this.group.visible = false;
  }

  // The robot's own parts: their surfaces are shared.
  show(robot: readonly Group[]): void {
    this.#bodies = robot.map((body) => body.clone());
    for (const part of this.#bodies.flatMap((body) => body.children)) {
      part.castShadow = part.receiveShadow = false;
      if (part instanceof Mesh) part.material = this.#skin;
    }
    this.group.clear();
    this.group.add(...this.#bodies);
  }

  follow({ target, running }: Frame, now: number): void {
    if (running) this.#motion.moveTo(target, now);
    else this.#motion.jumpTo(target, now);
  }

  // True while there is more to come.
  apply(now: number): boolean {
    return this.group.visible && this.#motion.apply(this.#bodies, now);
  }

  paint(colors: Colors): void {
    this.#skin.color = colors.target;
  }
}
