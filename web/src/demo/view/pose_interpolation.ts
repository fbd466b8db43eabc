// Interpolates body poses between frames of the worker (up to 30 Hz) for the display (60 Hz or more).

import { type Object3D, Quaternion, Vector3 } from "three";

// Numbers per pose: position, quaternion.
const POSE_SIZE = 7;
// A longer gap between frames is a pause, not a slow tick (ms).
const MAX_GAP_MS = 400;

const position = new Vector3();
const rotation = new Quaternion();

export class PoseInterpolator {
  #from: Float32Array = new Float32Array(0);
  #to: Float32Array = new Float32Array(0);
  #arrived = 0;
  #duration = 0;

  // Moves from the previous poses to these over the time between their frames. The display lags by one tick.
  moveTo(poses: Float32Array, now: number): void {
    const gap = now - this.#arrived;
    if (poses.length !== this.#to.length || gap > MAX_GAP_MS) return this.jumpTo(poses, now);
    this.#from = this.#to;
    this.#to = poses;
    this.#duration = gap;
    this.#arrived = now;
  }

  jumpTo(poses: Float32Array, now: number): void {
    this.#from = this.#to = poses;
    this.#duration = 0;
    this.#arrived = now;
  }

  // Sets the poses of the bodies. Returns whether the motion is unfinished.
  apply(bodies: readonly Object3D[], now: number): boolean {
    // The time of an animation frame can precede the arrival of the message.
    const elapsed = Math.max(0, now - this.#arrived);
    const fraction = this.#duration > 0 ? Math.min(1, elapsed / this.#duration) : 1;
    bodies.forEach((body, index) => this.#interpolate(body, index * POSE_SIZE, fraction));
    return fraction < 1;
  }

  #interpolate(body: Object3D, offset: number, fraction: number): void {
    if (offset + POSE_SIZE > this.#to.length) return;
    body.position.fromArray(this.#from, offset).lerp(position.fromArray(this.#to, offset), fraction);
    body.quaternion.fromArray(this.#from, offset + 3).slerp(rotation.fromArray(this.#to, offset + 3), fraction);
  }
}
