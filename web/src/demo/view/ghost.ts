// Where the commands would have the robot, through all that stands before it: fingers that are stopped by the object are
// commanded to be inside, and press.

import { Group, Mesh, MeshBasicMaterial } from "three";
import type { Frame, Link } from "../protocol";
import { clear, grouped } from "./bodies";
import type { Colors } from "./colors";
import { Motion } from "./motion";
import { geometryOf } from "./shape";

export class Ghost {
  readonly group = new Group();
  readonly #skin = new MeshBasicMaterial({ transparent: true, opacity: 0.35, depthTest: false, depthWrite: false });
  readonly #motion = new Motion();
  #bodies: Group[] = [];

  constructor() {
    this.group.visible = false;
  }

  // The robot's own parts.
  show(links: readonly Link[]): void {
    this.#bodies.forEach(clear);
    this.#bodies = grouped(links, (shape) => new Mesh(geometryOf(shape), this.#skin));
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
