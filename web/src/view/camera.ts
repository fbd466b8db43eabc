// The viewer's camera: orbit by hand, fly to a preset.

import { MathUtils, PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { DepthCamera } from "../protocol";

export type Preset = "home" | "front" | "side" | "top" | "sensor";

const PRESETS: Record<Exclude<Preset, "sensor">, { from: Vector3; at: Vector3 }> = {
  home: { from: new Vector3(2.3, -1.75, 1.3), at: new Vector3(0.42, 0, 0.29) },
  front: { from: new Vector3(2.9, 0, 0.6), at: new Vector3(0.4, 0, 0.36) },
  side: { from: new Vector3(0.42, -2.6, 0.6), at: new Vector3(0.42, 0, 0.36) },
  top: { from: new Vector3(0.45, -0.001, 2.7), at: new Vector3(0.45, 0, 0) },
};
const FLIGHT_MS = 500;
// The presets are framed for this angle (degrees) and shape; a narrower window widens the angle.
const FIELD_OF_VIEW = 32;
const ASPECT = 1;

const isCalm = matchMedia("(prefers-reduced-motion: reduce)");

export class Viewpoint {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.02, 30);
  readonly controls: OrbitControls;
  #sensor: DepthCamera | null = null;
  #flight: { from: Vector3; at: Vector3; toFrom: Vector3; toAt: Vector3; begin: number } | null = null;

  constructor(canvas: HTMLCanvasElement, changed: () => void) {
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = !isCalm.matches;
    this.controls.dampingFactor = 0.12;
    this.controls.minDistance = 0.25;
    this.controls.maxDistance = 6;
    this.controls.maxPolarAngle = MathUtils.degToRad(92);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", changed);
    this.controls.addEventListener("start", () => {
      this.#flight = null;
      changed();
    });
  }

  set sensor(sensor: DepthCamera) {
    this.#sensor = sensor;
  }

  // What is framed is centred in the part of the window that nothing covers from below.
  resize(width: number, height: number, covered: number): void {
    this.camera.aspect = width / height;
    const free = (height - covered) / height;
    const widen = Math.max(1 / free, ASPECT / this.camera.aspect);
    const tan = Math.tan(MathUtils.degToRad(FIELD_OF_VIEW / 2)) * widen;
    this.camera.fov = MathUtils.radToDeg(2 * Math.atan(tan));
    this.camera.setViewOffset(width, height, 0, covered / 2, width, height);
  }

  goTo(preset: Preset, now: number, atOnce = isCalm.matches): void {
    const { from, at } = this.#find(preset);
    if (atOnce) {
      this.camera.position.copy(from);
      this.controls.target.copy(at);
      return;
    }
    const { position } = this.camera;
    this.#flight = { from: position.clone(), at: this.controls.target.clone(), toFrom: from, toAt: at, begin: now };
  }

  // True while it is still moving.
  update(now: number): boolean {
    const flight = this.#flight;
    if (flight) {
      const share = Math.min(1, (now - flight.begin) / FLIGHT_MS);
      const eased = share * share * (3 - 2 * share);
      this.camera.position.lerpVectors(flight.from, flight.toFrom, eased);
      this.controls.target.lerpVectors(flight.at, flight.toAt, eased);
      if (share === 1) this.#flight = null;
    }
    return this.controls.update() || this.#flight !== null;
  }

  #find(preset: Preset): { from: Vector3; at: Vector3 } {
    if (preset !== "sensor") return PRESETS[preset];
    if (!this.#sensor) return PRESETS.home;
    return { from: new Vector3(...this.#sensor.position), at: new Vector3(...this.#sensor.target) };
  }
}
