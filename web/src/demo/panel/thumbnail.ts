// Thumbnail of a mesh, rasterised on the CPU: viewed from slightly above, lit from the left.

import { Color, Matrix4, Vector3 } from "three";
import type { Shape } from "../worker/protocol";

const PIXELS = 56;
const MARGIN = 2;
// Supersampling: samples per pixel along each axis.
const SAMPLES = 3;
const SIDE = PIXELS * SAMPLES;
// View direction, and the image axes in world coordinates.
const BACK = new Vector3(-0.72, -0.52, 0.46).normalize();
const RIGHT = new Vector3(0, 0, 1).cross(BACK).normalize();
const DOWN = new Vector3().crossVectors(RIGHT, BACK);
const TO_IMAGE = new Matrix4().makeBasis(RIGHT, DOWN, BACK).transpose();
const LIGHT = new Vector3(-0.3, -0.75, 0.6).normalize().applyMatrix4(TO_IMAGE);

// Rendering is deferred until after the next frame of the scene, which has priority.
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
  const image = raster.createImageData(SIDE, SIDE);
  paint(image.data, toImage(positions), indices, new Color(color));
  raster.putImageData(image, 0, 0);
  context.imageSmoothingQuality = "high";
  context.drawImage(fine, 0, 0, PIXELS, PIXELS);
}

function square(side: number): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = side;
  return canvas;
}

// Vertices in image coordinates (right, down, towards the viewer), in samples, scaled to fill the image.
function toImage(positions: ArrayLike<number>): Float32Array {
  const corners = new Float32Array(positions.length);
  const point = new Vector3();
  const min = new Vector3(Infinity, Infinity, 0);
  const max = new Vector3(-Infinity, -Infinity, 0);
  for (let i = 0; i < corners.length; i += 3) {
    point.fromArray(positions, i).applyMatrix4(TO_IMAGE).toArray(corners, i);
    min.min(point);
    max.max(point);
  }
  const scale = (SIDE - 2 * MARGIN * SAMPLES) / Math.max(max.x - min.x, max.y - min.y);
  for (let i = 0; i < corners.length; i += 3) {
    corners[i] = SIDE / 2 + scale * (corners[i]! - (min.x + max.x) / 2);
    corners[i + 1] = SIDE / 2 + scale * (corners[i + 1]! - (min.y + max.y) / 2);
    corners[i + 2] = scale * corners[i + 2]!;
  }
  return corners;
}

// Rasterises the triangles with a depth buffer.
function paint(pixels: Uint8ClampedArray, corners: Float32Array, indices: ArrayLike<number>, color: Color): void {
  const depths = new Float32Array(SIDE * SIDE).fill(-Infinity);
  const [p, q, r, normal] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
  const shaded = new Color();
  for (let i = 0; i + 2 < indices.length; i += 3) {
    p.fromArray(corners, 3 * indices[i]!);
    q.fromArray(corners, 3 * indices[i + 1]!).sub(p);
    r.fromArray(corners, 3 * indices[i + 2]!).sub(p);
    normal.crossVectors(q, r);
    const area = normal.z;
    if (area === 0) continue;
    // Two-sided shading: back faces are lit like front faces.
    const facing = Math.sign(area) / normal.length();
    shaded.copy(color).multiplyScalar(0.55 + 0.55 * Math.max(0, facing * normal.dot(LIGHT)));
    const rgb = shaded.getHex();
    const [left, right] = [p.x + Math.min(0, q.x, r.x), p.x + Math.max(0, q.x, r.x)];
    const [top, bottom] = [p.y + Math.min(0, q.y, r.y), p.y + Math.max(0, q.y, r.y)];
    for (let y = Math.ceil(top); y <= bottom; y++) {
      for (let x = Math.ceil(left); x <= right; x++) {
        // Barycentric coordinates of the sample.
        const u = ((x - p.x) * r.y - (y - p.y) * r.x) / area;
        const v = (q.x * (y - p.y) - q.y * (x - p.x)) / area;
        if (u < 0 || v < 0 || u + v > 1) continue;
        const depth = p.z + u * q.z + v * r.z;
        const sample = y * SIDE + x;
        if (!(depth > depths[sample]!)) continue;
        depths[sample] = depth;
        pixels.set([rgb >> 16, (rgb >> 8) & 255, rgb & 255, 255], 4 * sample);
      }
    }
  }
}
