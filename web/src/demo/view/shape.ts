// Surfaces of the protocol as geometry to draw.

import { BufferAttribute, BufferGeometry } from "three";
import type { Shape } from "../protocol";

// Edges sharper than this are drawn sharp (radians).
const CREASE = 0.6;
// Above this, a surface is drawn smooth: apart at its edges it would take several times the memory.
const MANY_TRIANGLES = 40_000;

export function geometryOf(shape: Shape): BufferGeometry {
  if (shape.indices.length / 3 <= MANY_TRIANGLES) return creased(shape);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(shape.positions, 3));
  geometry.setIndex(new BufferAttribute(shape.indices, 1));
  geometry.computeVertexNormals();
  return geometry;
}

// Triangles apart: at each corner the mean normal of those about its vertex that bend away by less than an edge.
function creased({ positions, indices }: Shape): BufferGeometry {
  const flat = facing(positions, indices);
  const [first, about] = byVertex(positions.length / 3, indices);
  const corners = new Float32Array(3 * indices.length);
  const normals = new Float32Array(3 * indices.length);
  const least = Math.cos(CREASE);
  for (let corner = 0; corner < indices.length; corner++) {
    const vertex = indices[corner]!;
    const own = corner - (corner % 3);
    let x = 0;
    let y = 0;
    let z = 0;
    for (let i = first[vertex]!; i < first[vertex + 1]!; i++) {
      const other = about[i]!;
      if (dot(flat, own, other) <= least) continue;
      x += flat[other]!;
      y += flat[other + 1]!;
      z += flat[other + 2]!;
    }
    put(normals, 3 * corner, x, y, z);
    for (let axis = 0; axis < 3; axis++) corners[3 * corner + axis] = positions[3 * vertex + axis]!;
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(corners, 3));
  geometry.setAttribute("normal", new BufferAttribute(normals, 3));
  return geometry;
}

// The normals of triangles.
function facing(positions: Float32Array, indices: Uint32Array): Float32Array {
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
    put(normals, t, uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
  }
  return normals;
}

// For each vertex, where the triangles about it stand among all, and these, by the index of their first corner.
function byVertex(vertices: number, indices: Uint32Array): [Uint32Array, Uint32Array] {
  const first = new Uint32Array(vertices + 1);
  for (const vertex of indices) first[vertex + 1]!++;
  for (let vertex = 0; vertex < vertices; vertex++) first[vertex + 1]! += first[vertex]!;
  const next = first.slice();
  const about = new Uint32Array(indices.length);
  for (let corner = 0; corner < indices.length; corner++) about[next[indices[corner]!]!++] = corner - (corner % 3);
  return [first, about];
}

function dot(vectors: Float32Array, a: number, b: number): number {
  return vectors[a]! * vectors[b]! + vectors[a + 1]! * vectors[b + 1]! + vectors[a + 2]! * vectors[b + 2]!;
}

// Puts a vector there at length one, or as zeros where it has none.
function put(vectors: Float32Array, at: number, x: number, y: number, z: number): void {
  const length = Math.sqrt(x * x + y * y + z * z) || 1;
  vectors[at] = x / length;
  vectors[at + 1] = y / length;
  vectors[at + 2] = z / length;
}
