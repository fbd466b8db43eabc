// What moves: the robot's links and the object with its collision hulls.

import {
  BufferGeometry,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshLambertMaterial,
  type Object3D,
} from "three";
import type { Link, ObjectLoaded } from "../protocol";
import type { Colors } from "./colors";
import { geometryOf } from "./shape";

// The robot: a group per body, in the order of their poses.
export function robotBodies(links: readonly Link[]): Group[] {
  const bodies: Group[] = [];
  for (const { body, color, shape } of links) {
    const material = new MeshLambertMaterial({ color });
    (bodies[body] ??= new Group()).add(shadowed(new Mesh(geometryOf(shape), material)));
  }
  // A body that nothing is drawn of still has a pose.
  return Array.from(bodies, (body) => body ?? new Group());
}

// The object is drawn in the accent colour: it is what everything here is about.
export class Thing {
  readonly group = new Group();
  readonly #skin = new MeshLambertMaterial({ transparent: true });
  readonly #edges = new LineBasicMaterial({ transparent: true, opacity: 0.75 });
  readonly #mesh = shadowed(new Mesh(new BufferGeometry(), this.#skin));
  readonly #hulls = new Group();

  constructor() {
    this.#hulls.visible = false;
    this.group.add(this.#mesh, this.#hulls);
  }

  // For picking: the bounding box is near enough, and as quick for a million triangles as for ten.
  get bounds() {
    return this.#mesh.geometry.boundingBox;
  }

  show(loaded: ObjectLoaded): void {
    this.#mesh.geometry.dispose();
    this.#mesh.geometry = geometryOf(loaded.shape);
    this.#mesh.geometry.computeBoundingBox();
    clear(this.#hulls);
    for (const hull of loaded.hulls) {
      const surface = geometryOf(hull);
      this.#hulls.add(new LineSegments(new EdgesGeometry(surface, 12), this.#edges));
      surface.dispose();
    }
  }

  showHulls(on: boolean): void {
    this.#hulls.visible = on;
    this.#skin.opacity = on ? 0.4 : 1;
    this.#skin.depthWrite = !on;
  }

  paint(colors: Colors): void {
    this.#skin.color = colors.accent;
    this.#edges.color = colors.ink;
  }
}

function shadowed(mesh: Mesh<BufferGeometry, MeshLambertMaterial>) {
  mesh.castShadow = mesh.receiveShadow = true;
  return mesh;
}

// Takes everything out of a group and frees what it holds on the graphics card: geometry, and the
// shadows of lights.
export function clear(group: Group): void {
  type Held = Object3D & { geometry?: BufferGeometry; dispose?: () => void };
  for (const child of group.children as Held[]) {
    child.geometry?.dispose();
    child.dispose?.();
  }
  group.clear();
}
