// Camera of the view: orbit controls and animated presets.

import { MathUtils, PerspectiveCamera, Quaternion, Spherical, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Table, DepthCamera } from "../worker/protocol";

export type Preset = "home" | "front" | "side" | "top" | "sensor";

// Camera position and orbit target.
interface CameraPose {
  position: Vector3;
  target: Vector3;
}

// Camera position and target relative to the centre of the table top (m).
const PRESETS: Record<Exclude<Preset, "sensor">, { position: number[]; target: number[] }> = {
  home: { position: [1.85, -1.95, 1.45], target: [-0.2, 0, 0.36] },
  front: { position: [2.7, 0, 0.7], target: [-0.2, 0, 0.38] },
  side: { position: [-0.2, -2.9, 0.7], target: [-0.2, 0, 0.38] },
  top: { position: [-0.15, -0.001, 2.9], target: [-0.15, 0, 0] },
};
const FLIGHT_MS = 500;
// Rotation from z-up (the scene) to y-up (three's spherical coordinates).
const Y_UP_FROM_Z_UP = new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), new Vector3(0, 1, 0));
// The presets assume this vertical field of view (degrees) and aspect ratio; a narrower window widens the
// angle.
const FIELD_OF_VIEW = 32;
const ASPECT = 1;

const prefersReducedMotion = matchMedia("(prefers-reduced-motion: reduce)");

export class OrbitCamera {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.02, 30);
  readonly controls: OrbitControls;
  readonly #onUserMove: () => void;
  #scene: { table: Table; camera: DepthCamera } | null = null;
  #flight: { startTime: number; start: CameraPose; end: CameraPose } | null = null;

  // `onUserMove` is called when the user moves the camera by pointer or key.
  constructor(canvas: HTMLCanvasElement, onChange: () => void, onUserMove: () => void) {
    this.#onUserMove = onUserMove;
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = !prefersReducedMotion.matches;
    this.controls.dampingFactor = 0.12;
    this.controls.minDistance = 0.25;
    this.controls.maxDistance = 6;
    this.controls.maxPolarAngle = MathUtils.degToRad(92);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", onChange);
    this.controls.addEventListener("start", () => {
      this.#stopFlight();
      onChange();
    });
  }

  #stopFlight(): void {
    this.#flight = null;
    this.#onUserMove();
  }

  set scene(scene: { table: Table; camera: DepthCamera }) {
    this.#scene = scene;
  }

  // Centres the scene in the part of the canvas that is not covered from below.
  resize(width: number, height: number, covered: number): void {
    this.camera.aspect = width / height;
    const visible = (height - covered) / height;
    const widen = Math.max(1 / visible, ASPECT / this.camera.aspect);
    const tan = Math.tan(MathUtils.degToRad(FIELD_OF_VIEW / 2)) * widen;
    this.camera.fov = MathUtils.radToDeg(2 * Math.atan(tan));
    this.camera.setViewOffset(width, height, 0, covered / 2, width, height);
  }

  goTo(preset: Preset, now: number, isInstant = prefersReducedMotion.matches): void {
    const end = this.#presetPose(preset);
    const start = { position: this.camera.position.clone(), target: this.controls.target.clone() };
    this.#flight = { startTime: isInstant ? -Infinity : now, start, end };
  }

  // Orbits to the right and up (rad), up to the limit of the polar angle.
  rotate(right: number, up: number): void {
    this.#stopFlight();
    const offset = this.camera.position.clone().sub(this.controls.target).applyQuaternion(Y_UP_FROM_Z_UP);
    const spherical = new Spherical().setFromVector3(offset);
    spherical.theta += right;
    spherical.phi = MathUtils.clamp(spherical.phi - up, 0.01, this.controls.maxPolarAngle);
    this.camera.position.setFromSpherical(spherical).applyQuaternion(Y_UP_FROM_Z_UP.clone().invert()).add(this.controls.target);
  }

  // Moves closer by this fraction of the distance; negative moves away.
  zoom(fraction: number): void {
    this.#stopFlight();
    const offset = this.camera.position.clone().sub(this.controls.target);
    const { minDistance, maxDistance } = this.controls;
    offset.setLength(MathUtils.clamp(offset.length() * (1 - fraction), minDistance, maxDistance));
    this.camera.position.copy(this.controls.target).add(offset);
  }

  // Camera position, then orbit target.
  getView(): number[] {
    return [...this.camera.position.toArray(), ...this.controls.target.toArray()];
  }

  setView(numbers: number[]): void {
    this.#flight = null;
    this.camera.position.fromArray(numbers);
    this.controls.target.fromArray(numbers, 3);
  }

  // Returns whether the camera is still moving.
  update(now: number): boolean {
    if (this.#flight) {
      const { startTime, start, end } = this.#flight;
      const fraction = Math.min(1, (now - startTime) / FLIGHT_MS);
      const eased = fraction * fraction * (3 - 2 * fraction);
      this.camera.position.lerpVectors(start.position, end.position, eased);
      this.controls.target.lerpVectors(start.target, end.target, eased);
      if (fraction === 1) this.#flight = null;
    }
    return this.controls.update() || this.#flight !== null;
  }

  #presetPose(preset: Preset): CameraPose {
    if (!this.#scene) return { position: new Vector3(2, -2, 1.5), target: new Vector3() };
    const { table, camera } = this.#scene;
    if (preset === "sensor") {
      return { position: new Vector3(...camera.position), target: new Vector3(...camera.target) };
    }
    const top = new Vector3(...table.center);
    top.z += table.half[2];
    const { position, target } = PRESETS[preset];
    return { position: new Vector3(...position).add(top), target: new Vector3(...target).add(top) };
  }
}
