// Dragging the object over the table, and pulling at it while the hand has to do with it.

import { type Camera, Plane, Raycaster, Vector2, Vector3 } from "three";
import type { Pull, Rectangle } from "../protocol";
import type { Thing } from "./bodies";

export interface Draggable {
  camera: Camera;
  thing: Thing;
  // While an attempt runs, the object is not ours to move.
  isFree(): boolean;
  // But ours to pull at, also afterwards if that is asked for.
  isPullable(asked: boolean): boolean;
  // Called at the beginning and at the end.
  grabbed(on: boolean): void;
  moved(x: number, y: number): void;
  pulled(pull: Pull | null): void;
}

// A finger that has gone less far (px) may be the first of two, which zoom.
const SLOP = 8;

export function dragObject(canvas: HTMLCanvasElement, workspace: Rectangle, target: Draggable): void {
  const raycaster = new Raycaster();
  // The plane in which the pointer moves.
  const plane = new Plane(new Vector3(0, 0, 1), 0);
  const hit = new Vector3();
  // From the object's origin to where it was grabbed, on the table.
  const offset = new Vector3();
  // How the drag began, if there is one, which the camera was not told; while it is told, that is not ours.
  let begun: PointerEvent | null = null;
  let hasGone = false;
  let isPassedOn = false;
  // Where it was grabbed, in its own frame, if it is pulled at.
  let held: [number, number, number] | null = null;

  const aim = (event: PointerEvent) => {
    const box = canvas.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * 2 - 1;
    const y = 1 - ((event.clientY - box.top) / box.height) * 2;
    raycaster.setFromCamera(new Vector2(x, y), target.camera);
  };

  const isOver = (event: PointerEvent) => {
    const { bounds, group } = target.thing;
    if (!bounds || !(target.isFree() || target.isPullable(event.ctrlKey))) return false;
    aim(event);
    const ray = raycaster.ray.clone().applyMatrix4(group.matrixWorld.clone().invert());
    return ray.intersectBox(bounds, hit) !== null;
  };

  // Before the camera's own listener, which would begin to orbit.
  canvas.addEventListener(
    "pointerdown",
    (event) => {
      if (isPassedOn) return;
      // A second finger zooms: it ends a drag and begins none. The camera has to know of the first, too.
      if (begun && !event.isPrimary) {
        const first = begun;
        release(first.pointerId);
        isPassedOn = true;
        canvas.dispatchEvent(new PointerEvent(first.type, first));
        isPassedOn = false;
      }
      if (event.button !== 0 || !event.isPrimary || begun || !isOver(event)) return;
      event.stopImmediatePropagation();
      const { matrixWorld, position } = target.thing.group;
      held = target.isPullable(event.ctrlKey) ? [hit.x, hit.y, hit.z] : null;
      hit.applyMatrix4(matrixWorld);
      // Through the point that was grabbed, so that it stays under the pointer: along the table, or, to pull, as the
      // viewer sees it.
      if (held) plane.setFromNormalAndCoplanarPoint(target.camera.getWorldDirection(new Vector3()), hit);
      else plane.set(new Vector3(0, 0, 1), -hit.z);
      offset.subVectors(hit, position);
      begun = event;
      hasGone = event.pointerType !== "touch";
      canvas.setPointerCapture(event.pointerId);
      target.grabbed(true);
    },
    { capture: true },
  );

  canvas.addEventListener("pointermove", (event) => {
    if (!begun) {
      if (event.pointerType === "mouse") canvas.style.cursor = isOver(event) ? "grab" : "";
      return;
    }
    if (event.pointerId !== begun.pointerId) return;
    if (!held && !target.isFree()) return release(event.pointerId);
    hasGone ||= Math.hypot(event.clientX - begun.clientX, event.clientY - begun.clientY) >= SLOP;
    if (!hasGone) return;
    aim(event);
    if (!raycaster.ray.intersectPlane(plane, hit)) return;
    if (held) return target.pulled({ point: held, towards: [hit.x, hit.y, hit.z] });
    hit.sub(offset);
    target.moved(clamp(hit.x, workspace.x), clamp(hit.y, workspace.y));
  });

  const release = (id: number) => {
    if (id !== begun?.pointerId) return;
    begun = null;
    if (held) target.pulled(null);
    held = null;
    target.grabbed(false);
  };
  canvas.addEventListener("pointerup", (event) => release(event.pointerId));
  canvas.addEventListener("pointercancel", (event) => release(event.pointerId));
}

function clamp(value: number, [least, most]: [number, number]): number {
  return Math.min(most, Math.max(least, value));
}
