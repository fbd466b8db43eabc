// Point cloud of the depth camera, and the camera's frustum.

import {
  BufferAttribute,
  BufferGeometry,
  CanvasTexture,
  Group,
  LineBasicMaterial,
  LineSegments,
  Points,
  PointsMaterial,
  Vector3,
} from "three";
import type { DepthCamera } from "../worker/protocol";
import type { Colors } from "./colors";

// Closer to the view's camera than this, the frustum is hidden (m).
const MIN_DISTANCE = 0.3;

export class PointCloud {
  readonly points = new Points(
    new BufferGeometry(),
    new PointsMaterial({ size: 0.0065, map: disc(), alphaTest: 0.15, transparent: true }),
  );

  constructor() {
    // Rendered over the object, whose surface coincides with the points.
    this.points.material.depthTest = false;
    this.points.renderOrder = 1;
    this.points.frustumCulled = false;
  }

  show(positions: Float32Array): void {
    this.points.geometry.dispose();
    this.points.geometry = new BufferGeometry();
    this.points.geometry.setAttribute("position", new BufferAttribute(positions, 3));
  }

  // Fades the cloud once the object may have moved since the capture.
  fade(on: boolean): void {
    this.points.material.opacity = on ? 0.3 : 1;
  }

  setColors(colors: Colors): void {
    this.points.material.color = colors.cloud;
  }
}

// The depth camera as a small pyramid: apex at the lens, base in the viewing direction.
export class SensorFrustum {
  readonly group = new Group();
  readonly #material = new LineBasicMaterial();

  constructor(camera: DepthCamera) {
    const depth = 0.16;
    const x = depth * Math.tan((camera.hfovDeg * Math.PI) / 360);
    const y = x / camera.aspect;
    const corners = [new Vector3(-x, -y, depth), new Vector3(x, -y, depth), new Vector3(x, y, depth), new Vector3(-x, y, depth)];
    const apex = new Vector3();
    const ends = corners.flatMap((corner, i) => [apex, corner, corner, corners[(i + 1) % 4]!]);
    this.group.add(new LineSegments(new BufferGeometry().setFromPoints(ends), this.#material));
    this.group.position.set(...camera.position);
    this.group.up.set(0, 0, 1);
    this.group.lookAt(...camera.target);
    this.show(false, null);
  }

  // Hidden from near the sensor's own position, where it would obstruct the view.
  show(on: boolean, cameraPosition: Vector3 | null): void {
    this.group.visible = on && (cameraPosition?.distanceTo(this.group.position) ?? 0) > MIN_DISTANCE;
  }

  setColors(colors: Colors): void {
    this.#material.color = colors.ink;
  }
}

function disc(): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 32;
  const context = canvas.getContext("2d");
  if (context) {
    context.fillStyle = "#fff";
    context.arc(16, 16, 15, 0, 2 * Math.PI);
    context.fill();
  }
  return new CanvasTexture(canvas);
}
