// Moving bodies: the robot's links, and the object with its collision hulls.

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
import type { Link, ObjectLoaded } from "../worker/protocol";
import type { Colors } from "./colors";
import { toGeometry } from "./mesh_geometry";

// One group per body of the robot, in the order of the poses in a frame.
export function robotBodies(links: readonly Link[]): Group[] {
  const bodies: Group[] = [];
  for (const { body, color, shape } of links) {
    const material = new MeshLambertMaterial({ color });
    (bodies[body] ??= new Group()).add(withShadows(new Mesh(toGeometry(shape), material)));
  }
  // Bodies without meshes still have a pose.
  return Array.from(bodies, (body) => body ?? new Group());
}

// The object, in the accent colour.
export class ObjectBody {
  readonly group = new Group();
  readonly #material = new MeshLambertMaterial({ transparent: true });
  readonly #hullMaterial = new LineBasicMaterial({ transparent: true, opacity: 0.75 });
  readonly #mesh = withShadows(new Mesh(new BufferGeometry(), this.#material));
  readonly #hulls = new Group();

  constructor() {
    this.#hulls.visible = false;
    this.group.add(this.#mesh, this.#hulls);
  }

  // Used for picking instead of the mesh: constant time for any number of triangles.
  get bounds() {
    return this.#mesh.geometry.boundingBox;
  }

  show(loaded: ObjectLoaded): void {
    this.#mesh.geometry.dispose();
    this.#mesh.geometry = toGeometry(loaded.shape);
    this.#mesh.geometry.computeBoundingBox();
    clear(this.#hulls);
    for (const hull of loaded.hulls) {
      const surface = toGeometry(hull);
      this.#hulls.add(new LineSegments(new EdgesGeometry(surface, 12), this.#hullMaterial));
      surface.dispose();
    }
  }

  showHulls(on: boolean): void {
    this.#hulls.visible = on;
    this.#material.opacity = on ? 0.4 : 1;
    this.#material.depthWrite = !on;
  }

  setColors(colors: Colors): void {
    this.#material.color = colors.accent;
    this.#hullMaterial.color = colors.ink;
  }
}

function withShadows(mesh: Mesh<BufferGeometry, MeshLambertMaterial>) {
  mesh.castShadow = mesh.receiveShadow = true;
  return mesh;
}

// Empties a group and frees its GPU resources: geometries and shadow maps.
export function clear(group: Group): void {
  type Disposable = Object3D & { geometry?: BufferGeometry; dispose?: () => void };
  for (const child of group.children as Disposable[]) {
    child.geometry?.dispose();
    child.dispose?.();
  }
  group.clear();
}
