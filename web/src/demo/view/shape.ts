// Surfaces of the protocol as geometry to draw.

import { BufferAttribute, BufferGeometry } from "three";
import { toCreasedNormals } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { Shape } from "../protocol";

// Edges sharper than this are drawn sharp (radians).
const CREASE = 0.6;
// Above this, edges are not worth the seconds that finding them takes.
const MANY_TRIANGLES = 40_000;

export function geometryOf(shape: Shape): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(shape.positions, 3));
  geometry.setIndex(new BufferAttribute(shape.indices, 1));
  if (shape.indices.length / 3 <= MANY_TRIANGLES) return toCreasedNormals(geometry, CREASE);
  geometry.computeVertexNormals();
  return geometry;
}
