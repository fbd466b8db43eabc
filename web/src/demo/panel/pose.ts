// Object pose as numeric fields, and the keys that move the object.

import { element } from "../../common/dom";
import type { EventBus } from "../app/event_bus";
import type { Frame, PlanarPose, Rectangle } from "../worker/protocol";

const DEGREE = Math.PI / 180;
// Step of a key press (m, rad).
const STEP = 0.01;
const YAW_STEP = 5 * DEGREE;

// Pose change per key; x points away from the robot.
const NUDGES: Record<string, PlanarPose> = {
  ArrowUp: { x: -STEP, y: 0, yaw: 0 },
  ArrowDown: { x: STEP, y: 0, yaw: 0 },
  ArrowLeft: { x: 0, y: -STEP, yaw: 0 },
  ArrowRight: { x: 0, y: STEP, yaw: 0 },
  q: { x: 0, y: 0, yaw: YAW_STEP },
  e: { x: 0, y: 0, yaw: -YAW_STEP },
};

export class PosePanel {
  readonly #fields = element("pose", HTMLFieldSetElement);
  readonly #x = element("pose-x", HTMLInputElement);
  readonly #y = element("pose-y", HTMLInputElement);
  readonly #yaw = element("pose-yaw", HTMLInputElement);
  readonly #place: (pose: PlanarPose) => void;
  #pose: PlanarPose = { x: 0, y: 0, yaw: 0 };
  #isFree = false;

  constructor(bus: EventBus, place: (pose: PlanarPose) => void) {
    this.#place = place;
    // Only the changed value is set: the other fields are rounded.
    const unit = { x: 0.01, y: 0.01, yaw: DEGREE };
    for (const [key, input] of [["x", this.#x], ["y", this.#y], ["yaw", this.#yaw]] as const) {
      input.addEventListener("change", () => {
        const value = input.valueAsNumber;
        if (Number.isFinite(value)) this.#place({ ...this.#pose, [key]: value * unit[key] });
      });
      // The worker limits the pose to the workspace, so the field may differ from it.
      input.addEventListener("blur", () => this.#write());
    }
    bus.on("ready", ({ workspace }) => this.#setLimits(workspace));
    bus.on("frame", (frame) => this.#show(frame));
  }

  #setLimits({ x, y }: Rectangle): void {
    [this.#x.min, this.#x.max] = [cm(x[0]), cm(x[1])];
    [this.#y.min, this.#y.max] = [cm(y[0]), cm(y[1])];
  }

  #show({ pose, phase }: Frame): void {
    this.#pose = pose;
    this.#isFree = phase === "idle" || phase === "outcome";
    this.#fields.disabled = !this.#isFree;
    this.#write();
  }

  #write(): void {
    const { x, y, yaw } = this.#pose;
    write(this.#x, cm(x));
    write(this.#y, cm(y));
    write(this.#yaw, (yaw / DEGREE).toFixed(0));
  }

  // Moves the object by a key; returns whether the key was used.
  nudge(key: string): boolean {
    const change = NUDGES[key];
    if (!change || !this.#isFree) return false;
    const { x, y, yaw } = this.#pose;
    this.#place({ x: x + change.x, y: y + change.y, yaw: yaw + change.yaw });
    return true;
  }
}

// The focused field is not overwritten.
function write(input: HTMLInputElement, value: string): void {
  if (document.activeElement !== input && input.value !== value) input.value = value;
}

function cm(metres: number): string {
  return String(Math.round(metres * 100) || 0);
}
