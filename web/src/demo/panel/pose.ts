// Where the object stands, in numbers: the same as dragging it.

import { element } from "../../common/dom";
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
    // Only the number that was changed: the others are shown rounded.
    const unit = { x: 0.01, y: 0.01, yaw: DEGREE };
    for (const [key, input] of [["x", this.#x], ["y", this.#y], ["yaw", this.#yaw]] as const) {
      input.addEventListener("change", () => {
        const value = input.valueAsNumber;
        if (Number.isFinite(value)) this.#place({ ...this.#pose, [key]: value * unit[key] });
      });
      // What was typed may lie outside, and the object stops at the edge.
      input.addEventListener("blur", () => this.#write());
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
    this.#write();
  }

  #write(): void {
    const { x, y, yaw } = this.#pose;
    write(this.#x, cm(x));
    write(this.#y, cm(y));
    write(this.#yaw, (yaw / DEGREE).toFixed(0));
  }

  // True if this key moves the object.
  nudge(key: string): boolean {
    const by = NUDGES[key];
    if (!by || !this.#isFree) return false;
    const { x, y, yaw } = this.#pose;
    this.#place({ x: x + by.x, y: y + by.y, yaw: yaw + by.yaw });
    return true;
  }
}

// What is being typed is left alone.
function write(input: HTMLInputElement, value: string): void {
  if (document.activeElement !== input && input.value !== value) input.value = value;
}

function cm(metres: number): string {
  return String(Math.round(metres * 100) || 0);
}
