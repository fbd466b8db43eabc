// The viewer's camera: orbit by hand, fly to a preset.

import { MathUtils, PerspectiveCamera, Quaternion, Spherical, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Box, DepthCamera } from "../protocol";

export type Preset = "home" | "front" | "side" | "top" | "sensor";

interface Stand {
  from: Vector3;
  at: Vector3;
}

// Where to stand, and where to look: both measured from the middle of the table's top.
const PRESETS: Record<Exclude<Preset, "sensor">, { from: number[]; at: number[] }> = {
  home: { from: [1.85, -1.95, 1.45], at: [-0.2, 0, 0.36] },
  front: { from: [2.7, 0, 0.7], at: [-0.2, 0, 0.38] },
  side: { from: [-0.2, -2.9, 0.7], at: [-0.2, 0, 0.38] },
  top: { from: [-0.15, -0.001, 2.9], at: [-0.15, 0, 0] },
};
const FLIGHT_MS = 500;
// From z upwards, as here, to y upwards, as angles on a sphere are counted.
const UPRIGHT = new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), new Vector3(0, 1, 0));
// The presets are framed for this angle (degrees) and shape; a narrower window widens the angle.
const FIELD_OF_VIEW = 32;
const ASPECT = 1;

const isCalm = matchMedia("(prefers-reduced-motion: reduce)");

export class Viewpoint {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.02, 30);
  readonly controls: OrbitControls;
  readonly #taken: () => void;
  #scene: { table: Box; camera: DepthCamera } | null = null;
  #flight: { begin: number; start: Stand; end: Stand } | null = null;

  // `taken` is told when somebody looks elsewhere by hand or key.
  constructor(canvas: HTMLCanvasElement, changed: () => void, taken: () => void) {
    this.#taken = taken;
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
      this.#take();
      changed();
    });
  }

  #take(): void {
    this.#flight = null;
    this.#taken();
  }

  set scene(scene: { table: Box; camera: DepthCamera }) {
    this.#scene = scene;
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
    const end = this.#find(preset);
    const start = { from: this.camera.position.clone(), at: this.controls.target.clone() };
    this.#flight = { begin: atOnce ? -Infinity : now, start, end };
  }

  // Turns about what is looked at: to the right and up (rad). The table is not looked at from below.
  turn(right: number, up: number): void {
    this.#take();
    const off = this.camera.position.clone().sub(this.controls.target).applyQuaternion(UPRIGHT);
    const at = new Spherical().setFromVector3(off);
    at.theta += right;
    at.phi = MathUtils.clamp(at.phi - up, 0.01, this.controls.maxPolarAngle);
    this.camera.position.setFromSpherical(at).applyQuaternion(UPRIGHT.clone().invert()).add(this.controls.target);
  }

  // Goes nearer by this share of the distance, or away.
  approach(share: number): void {
    this.#take();
    const off = this.camera.position.clone().sub(this.controls.target);
    const { minDistance, maxDistance } = this.controls;
    off.setLength(MathUtils.clamp(off.length() * (1 - share), minDistance, maxDistance));
    this.camera.position.copy(this.controls.target).add(off);
  }

  // Position, then what is looked at.
  stand(): number[] {
    return [...this.camera.position.toArray(), ...this.controls.target.toArray()];
  }

  standAt(numbers: number[]): void {
    this.#flight = null;
    this.camera.position.fromArray(numbers);
    this.controls.target.fromArray(numbers, 3);
  }

  // True while it is still moving.
  update(now: number): boolean {
    if (this.#flight) {
      const { begin, start, end } = this.#flight;
      const share = Math.min(1, (now - begin) / FLIGHT_MS);
      const eased = share * share * (3 - 2 * share);
      this.camera.position.lerpVectors(start.from, end.from, eased);
      this.controls.target.lerpVectors(start.at, end.at, eased);
      if (share === 1) this.#flight = null;
    }
    return this.controls.update() || this.#flight !== null;
  }

  #find(preset: Preset): Stand {
    if (!this.#scene) return { from: new Vector3(2, -2, 1.5), at: new Vector3() };
    const { table, camera } = this.#scene;
    if (preset === "sensor") return { from: new Vector3(...camera.position), at: new Vector3(...camera.target) };
    const top = new Vector3(...table.center);
    top.z += table.half[2];
    const { from, at } = PRESETS[preset];
    return { from: new Vector3(...from).add(top), at: new Vector3(...at).add(top) };
  }
}
