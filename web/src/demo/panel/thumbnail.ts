// A small picture of a shape, without the graphics card: seen a little from above, lit from the left.

import { Color, Matrix4, Vector3 } from "three";
import type { Shape } from "../protocol";

const PIXELS = 56;
const MARGIN = 2;
// Spots along a pixel's side at which the shape is looked at; the pixel is their mean.
const SPOTS = 3;
const SIDE = PIXELS * SPOTS;
// Where it is looked at from, and what leads to the right and downwards in the picture.
const BACK = new Vector3(-0.72, -0.52, 0.46).normalize();
const RIGHT = new Vector3(0, 0, 1).cross(BACK).normalize();
const DOWN = new Vector3().crossVectors(RIGHT, BACK);
const TO_PICTURE = new Matrix4().makeBasis(RIGHT, DOWN, BACK).transpose();
const LIGHT = new Vector3(-0.3, -0.75, 0.6).normalize().applyMatrix4(TO_PICTURE);

// It is painted after the next picture of the scene, for which people wait.
export function thumbnail(shape: Shape, color: string): HTMLCanvasElement {
  const canvas = square(PIXELS);
  canvas.setAttribute("aria-hidden", "true");
  requestAnimationFrame(() => setTimeout(() => draw(canvas, shape, color)));
  return canvas;
}

function draw(canvas: HTMLCanvasElement, { positions, indices }: Shape, color: string): void {
  const fine = square(SIDE);
  const [context, raster] = [canvas.getContext("2d"), fine.getContext("2d")];
  if (!context || !raster) return;
  const picture = raster.createImageData(SIDE, SIDE);
  paint(picture.data, inPicture(positions), indices, new Color(color));
  raster.putImageData(picture, 0, 0);
  context.imageSmoothingQuality = "high";
  context.drawImage(fine, 0, 0, PIXELS, PIXELS);
}

function square(side: number): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = side;
  return canvas;
}

// Corners to the right, down and towards the eye, in spots; the shape fills the picture.
function inPicture(positions: ArrayLike<number>): Float32Array {
  const corners = new Float32Array(positions.length);
  const point = new Vector3();
  const least = new Vector3(Infinity, Infinity, 0);
  const most = new Vector3(-Infinity, -Infinity, 0);
  for (let i = 0; i < corners.length; i += 3) {
    point.fromArray(positions, i).applyMatrix4(TO_PICTURE).toArray(corners, i);
    least.min(point);
    most.max(point);
  }
  const scale = (SIDE - 2 * MARGIN * SPOTS) / Math.max(most.x - least.x, most.y - least.y);
  for (let i = 0; i < corners.length; i += 3) {
    corners[i] = SIDE / 2 + scale * (corners[i]! - (least.x + most.x) / 2);
    corners[i + 1] = SIDE / 2 + scale * (corners[i + 1]! - (least.y + most.y) / 2);
    corners[i + 2] = scale * corners[i + 2]!;
  }
  return corners;
}

// Gives every spot the shade of the triangle that lies nearest there.
function paint(pixels: Uint8ClampedArray, corners: Float32Array, indices: ArrayLike<number>, color: Color): void {
  const nearest = new Float32Array(SIDE * SIDE).fill(-Infinity);
  const [p, q, r, normal] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
  const shaded = new Color();
  for (let i = 0; i + 2 < indices.length; i += 3) {
    p.fromArray(corners, 3 * indices[i]!);
    q.fromArray(corners, 3 * indices[i + 1]!).sub(p);
    r.fromArray(corners, 3 * indices[i + 2]!).sub(p);
    normal.crossVectors(q, r);
    const area = normal.z;
    if (area === 0) continue;
    // A surface has the same shade from both sides, if the eye can see it at all.
    const facing = Math.sign(area) / normal.length();
    shaded.copy(color).multiplyScalar(0.55 + 0.55 * Math.max(0, facing * normal.dot(LIGHT)));
    const rgb = shaded.getHex();
    const [left, right] = [p.x + Math.min(0, q.x, r.x), p.x + Math.max(0, q.x, r.x)];
    const [top, bottom] = [p.y + Math.min(0, q.y, r.y), p.y + Math.max(0, q.y, r.y)];
    for (let y = Math.ceil(top); y <= bottom; y++) {
      for (let x = Math.ceil(left); x <= right; x++) {
        // Barycentric coordinates of the spot.
        const u = ((x - p.x) * r.y - (y - p.y) * r.x) / area;
        const v = (q.x * (y - p.y) - q.y * (x - p.x)) / area;
        if (u < 0 || v < 0 || u + v > 1) continue;
        const depth = p.z + u * q.z + v * r.z;
        const spot = y * SIDE + x;
        if (!(depth > nearest[spot]!)) continue;
        nearest[spot] = depth;
        pixels.set([rgb >> 16, (rgb >> 8) & 255, rgb & 255, 255], 4 * spot);
      }
    }
  }
}
