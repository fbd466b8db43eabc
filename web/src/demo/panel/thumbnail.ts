// A small picture of a shape, without the graphics card: seen a little from above, lit from the left.

import { Color, Vector3 } from "three";
import type { Shape } from "../protocol";

// Triangles that are worth drawing so small.
const MOST = 4000;
const PIXELS = 56;
// Where it is looked at from, and what leads to the right and upwards in the picture.
const BACK = new Vector3(-0.72, -0.52, 0.46).normalize();
const RIGHT = new Vector3(0, 0, 1).cross(BACK).normalize();
const UP = new Vector3().crossVectors(BACK, RIGHT);
const LIGHT = new Vector3(-0.3, -0.75, 0.6).normalize();

export function thumbnail({ positions, indices }: Shape, color: string): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = PIXELS;
  canvas.setAttribute("aria-hidden", "true");
  const context = canvas.getContext("2d");
  if (!context) return canvas;

  const point = new Vector3();
  const seen = Array.from({ length: positions.length / 3 }, (_, i) => {
    point.fromArray(positions, 3 * i);
    return new Vector3(point.dot(RIGHT), -point.dot(UP), point.dot(BACK));
  });
  const least = new Vector3(Infinity, Infinity, 0);
  const most = new Vector3(-Infinity, -Infinity, 0);
  for (const corner of seen) [least.min(corner), most.max(corner)];
  const scale = (PIXELS - 4) / Math.max(most.x - least.x, most.y - least.y);
  const x = ({ x }: Vector3) => PIXELS / 2 + scale * (x - (least.x + most.x) / 2);
  const y = ({ y }: Vector3) => PIXELS / 2 + scale * (y - (least.y + most.y) / 2);

  const triangles: { depth: number; shade: number; corners: Vector3[] }[] = [];
  const step = 3 * Math.max(1, Math.ceil(indices.length / 3 / MOST));
  const [a, b, normal] = [new Vector3(), new Vector3(), new Vector3()];
  for (let i = 0; i + 2 < indices.length; i += step) {
    const corners = [indices[i]!, indices[i + 1]!, indices[i + 2]!];
    const [p, q, r] = corners.map((corner) => point.clone().fromArray(positions, 3 * corner));
    normal.crossVectors(a.subVectors(q!, p!), b.subVectors(r!, p!)).normalize();
    if (normal.dot(BACK) <= 0) continue;
    const ends = corners.map((corner) => seen[corner]!);
    const depth = ends.reduce((sum, { z }) => sum + z, 0);
    triangles.push({ depth, shade: 0.55 + 0.55 * Math.max(0, normal.dot(LIGHT)), corners: ends });
  }
  triangles.sort((one, other) => one.depth - other.depth);
  const base = new Color(color);
  for (const { shade, corners } of triangles) {
    context.fillStyle = context.strokeStyle = `#${base.clone().multiplyScalar(shade).getHexString()}`;
    context.beginPath();
    corners.forEach((corner) => context.lineTo(x(corner), y(corner)));
    context.closePath();
    context.fill();
    // Closes the seams between triangles.
    context.lineWidth = 0.6;
    context.stroke();
  }
  return canvas;
}
