// Solid segments between pairs of points, one instance of a mesh per segment. WebGL draws lines only one pixel
// wide.

import {
  type BufferGeometry,
  CylinderGeometry,
  DynamicDrawUsage,
  InstancedMesh,
  type Material,
  Matrix4,
  Quaternion,
  Vector3,
} from "three";

const SIDES = 8;
const AXIS = new Vector3(0, 0, 1);

export class SolidSegments {
  readonly mesh: InstancedMesh;
  readonly #capacity: number;
  readonly #matrix = new Matrix4();
  readonly #rotation = new Quaternion();
  readonly #direction = new Vector3();
  readonly #scale = new Vector3();

  constructor(geometry: BufferGeometry, material: Material, capacity: number) {
    this.#capacity = capacity;
    this.mesh = new InstancedMesh(geometry, material, capacity);
    this.mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    // The bounds of the instances change every frame.
    this.mesh.frustumCulled = false;
    this.mesh.count = 0;
  }

  // Sets segment `index` from `start` to `end`, with this radius (m).
  set(index: number, start: Vector3, end: Vector3, radius: number): void {
    if (index >= this.#capacity) return;
    const length = this.#direction.subVectors(end, start).length();
    if (length > 0) this.#rotation.setFromUnitVectors(AXIS, this.#direction.divideScalar(length));
    this.mesh.setMatrixAt(index, this.#matrix.compose(start, this.#rotation, this.#scale.set(radius, radius, length)));
    this.mesh.instanceMatrix.needsUpdate = true;
  }

  // Number of segments that are drawn.
  set count(count: number) {
    this.mesh.count = Math.min(count, this.#capacity);
  }
}

// Cylinder of radius 1 from the origin to (0, 0, 1).
export function unitCylinder(): BufferGeometry {
  return new CylinderGeometry(1, 1, 1, SIDES).rotateX(Math.PI / 2).translate(0, 0, 0.5);
}

// Cone of base radius 1 at the origin, with its tip at (0, 0, 1).
export function unitCone(): BufferGeometry {
  return new CylinderGeometry(0, 1, 1, 2 * SIDES).rotateX(Math.PI / 2).translate(0, 0, 0.5);
}
