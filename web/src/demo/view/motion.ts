// Poses between two ticks: the worker sends 30 a second or fewer, the screen shows 60 or more.

import { type Object3D, Quaternion, Vector3 } from "three";

// Position and quaternion.
const NUMBERS = 7;
// A longer gap than this was a pause, not a slow tick (ms).
const LONGEST = 400;

const position = new Vector3();
const rotation = new Quaternion();

export class Motion {
  #from: Float32Array = new Float32Array(0);
  #to: Float32Array = new Float32Array(0);
  #arrived = 0;
  #duration = 0;

  // From the last poses to these, in the time that lay between them: one tick behind, never ahead.
  moveTo(poses: Float32Array, now: number): void {
    const gap = now - this.#arrived;
    if (poses.length !== this.#to.length || gap > LONGEST) return this.jumpTo(poses, now);
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

  // Moves the bodies; true while there is more to come.
  apply(bodies: readonly Object3D[], now: number): boolean {
    // A frame's time may lie a little before the message that it shows.
    const elapsed = Math.max(0, now - this.#arrived);
    const share = this.#duration > 0 ? Math.min(1, elapsed / this.#duration) : 1;
    bodies.forEach((body, index) => this.#blend(body, index * NUMBERS, share));
    return share < 1;
  }

  #blend(body: Object3D, at: number, share: number): void {
    if (at + NUMBERS > this.#to.length) return;
    body.position.fromArray(this.#from, at).lerp(position.fromArray(this.#to, at), share);
    body.quaternion.fromArray(this.#from, at + 3).slerp(rotation.fromArray(this.#to, at + 3), share);
  }
}
