// Converts meshes of the protocol to three.js geometries.

import { BufferAttribute, BufferGeometry } from "three";
import type { Shape } from "../worker/protocol";

// Minimum angle of a sharp edge (rad).
const CREASE_ANGLE = 0.6;
// Larger meshes are shaded smoothly: separate vertices per triangle would multiply the memory.
const MAX_CREASED_TRIANGLES = 40_000;

export function toGeometry(shape: Shape): BufferGeometry {
  if (shape.indices.length / 3 <= MAX_CREASED_TRIANGLES) return creased(shape);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(shape.positions, 3));
  geometry.setIndex(new BufferAttribute(shape.indices, 1));
  geometry.computeVertexNormals();
  return geometry;
}

// Separate triangles. The normal of a corner is the mean over the triangles at its vertex within the crease
// angle.
function creased({ positions, indices }: Shape): BufferGeometry {
  const faceNormals = triangleNormals(positions, indices);
  const [first, adjacent] = trianglesByVertex(positions.length / 3, indices);
  const corners = new Float32Array(3 * indices.length);
  const normals = new Float32Array(3 * indices.length);
  const minCos = Math.cos(CREASE_ANGLE);
  for (let corner = 0; corner < indices.length; corner++) {
    const vertex = indices[corner]!;
    const own = corner - (corner % 3);
    let x = 0;
    let y = 0;
    let z = 0;
    for (let i = first[vertex]!; i < first[vertex + 1]!; i++) {
      const other = adjacent[i]!;
      if (dot(faceNormals, own, other) <= minCos) continue;
      x += faceNormals[other]!;
      y += faceNormals[other + 1]!;
      z += faceNormals[other + 2]!;
    }
    setUnit(normals, 3 * corner, x, y, z);
    for (let axis = 0; axis < 3; axis++) corners[3 * corner + axis] = positions[3 * vertex + axis]!;
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(corners, 3));
  geometry.setAttribute("normal", new BufferAttribute(normals, 3));
  return geometry;
}

function triangleNormals(positions: Float32Array, indices: Uint32Array): Float32Array {
  const normals = new Float32Array(indices.length);
  for (let t = 0; t < indices.length; t += 3) {
    const a = 3 * indices[t]!;
    const b = 3 * indices[t + 1]!;
    const c = 3 * indices[t + 2]!;
    const ux = positions[b]! - positions[a]!;
    const uy = positions[b + 1]! - positions[a + 1]!;
    const uz = positions[b + 2]! - positions[a + 2]!;
    const vx = positions[c]! - positions[a]!;
    const vy = positions[c + 1]! - positions[a + 1]!;
    const vz = positions[c + 2]! - positions[a + 2]!;
    setUnit(normals, t, uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
  }
  return normals;
}

// Adjacent triangles of each vertex, as offsets into one list of first-corner indices.
function trianglesByVertex(vertices: number, indices: Uint32Array): [Uint32Array, Uint32Array] {
  const first = new Uint32Array(vertices + 1);
  for (const vertex of indices) first[vertex + 1]!++;
  for (let vertex = 0; vertex < vertices; vertex++) first[vertex + 1]! += first[vertex]!;
  const next = first.slice();
  const adjacent = new Uint32Array(indices.length);
  for (let corner = 0; corner < indices.length; corner++) adjacent[next[indices[corner]!]!++] = corner - (corner % 3);
  return [first, adjacent];
}

function dot(vectors: Float32Array, a: number, b: number): number {
  return vectors[a]! * vectors[b]! + vectors[a + 1]! * vectors[b + 1]! + vectors[a + 2]! * vectors[b + 2]!;
}

// Stores the normalised vector, or zeros for the zero vector.
function setUnit(vectors: Float32Array, offset: number, x: number, y: number, z: number): void {
  const length = Math.sqrt(x * x + y * y + z * z) || 1;
  vectors[offset] = x / length;
  vectors[offset + 1] = y / length;
  vectors[offset + 2] = z / length;
}
