// Where the object stands, in numbers: the same as dragging it.

import { element } from "../dom";
import type { Frame, PlanarPose, Rectangle } from "../protocol";

const DEGREE = Math.PI / 180;
const NUDGE = 0.01;
const TURN = 5 * DEGREE;

// What the arrow keys do; x points away from the robot.
const NUDGES: Record<string, PlanarPose> = {
  ArrowUp: { x: -NUDGE, y: 0, yaw: 0 },
  ArrowDown: { x: NUDGE, y: 0, yaw: 0 },
  ArrowLeft: { x: 0, y: -NUDGE, yaw: 0 },
  ArrowRight: { x: 0, y: NUDGE, yaw: 0 },
  q: { x: 0, y: 0, yaw: TURN },
  e: { x: 0, y: 0, yaw: -TURN },
};

export class PosePanel {
  readonly #fields = element("pose", HTMLFieldSetElement);
  readonly #x = element("pose-x", HTMLInputElement);
  readonly #y = element("pose-y", HTMLInputElement);
  readonly #yaw = element("pose-yaw", HTMLInputElement);
  readonly #place: (pose: PlanarPose) => void;
  #pose: PlanarPose = { x: 0, y: 0, yaw: 0 };
  #isFree = false;

  constructor(place: (pose: PlanarPose) => void) {
    this.#place = place;
    for (const input of [this.#x, this.#y, this.#yaw]) {
      input.addEventListener("change", () => this.#read());
    }
  }

  limit({ x, y }: Rectangle): void {
    [this.#x.min, this.#x.max] = [cm(x[0]), cm(x[1])];
    [this.#y.min, this.#y.max] = [cm(y[0]), cm(y[1])];
  }

  show({ pose, phase }: Frame): void {
    this.#pose = pose;
    this.#isFree = phase === "idle" || phase === "verdict";
    this.#fields.disabled = !this.#isFree;
    write(this.#x, cm(pose.x));
    write(this.#y, cm(pose.y));
    write(this.#yaw, (pose.yaw / DEGREE).toFixed(0));
  }

  // True if this key moves the object.
  nudge(key: string): boolean {
    const by = NUDGES[key];
    if (!by || !this.#isFree) return false;
    const { x, y, yaw } = this.#pose;
    this.#place({ x: x + by.x, y: y + by.y, yaw: yaw + by.yaw });
    return true;
  }

  #read(): void {
    const [x, y, yaw] = [this.#x, this.#y, this.#yaw].map((input) => input.valueAsNumber);
    if (x === undefined || y === undefined || yaw === undefined) return;
    if (Number.isFinite(x + y + yaw)) this.#place({ x: x / 100, y: y / 100, yaw: yaw * DEGREE });
  }
}

// What is being typed is left alone.
function write(input: HTMLInputElement, value: string): void {
  if (document.activeElement !== input && input.value !== value) input.value = value;
}

function cm(metres: number): string {
  return String(Math.round(metres * 100) || 0);
}
