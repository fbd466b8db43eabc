// Pointer input on the object: moving it on the table, or pulling it during an attempt.

import { type Camera, Plane, Raycaster, Vector2, Vector3 } from "three";
import type { Drag, Rectangle } from "../worker/protocol";
import type { ObjectBody } from "./bodies";

export interface Draggable {
  camera: Camera;
  object: ObjectBody;
  // The object can be moved while no attempt is running.
  canMove(): boolean;
  // It can be pulled during an attempt, and with the modifier key also after it.
  canPull(hasModifier: boolean): boolean;
  // Called at the start (true) and at the end (false) of a drag.
  onGrab(on: boolean): void;
  onMove(x: number, y: number): void;
  onPull(drag: Drag | null): void;
}

// A touch that has moved less than this may become a pinch (px).
const TOUCH_SLOP = 8;

export function dragObject(canvas: HTMLCanvasElement, workspace: Rectangle, target: Draggable): void {
  const raycaster = new Raycaster();
  // Plane of the drag.
  const plane = new Plane(new Vector3(0, 0, 1), 0);
  const hit = new Vector3();
  // From the object's origin to the grabbed point (world frame).
  const offset = new Vector3();
  // First event of the current drag, which was hidden from the camera controls.
  let startEvent: PointerEvent | null = null;
  let hasMoved = false;
  // Whether that event is being dispatched again, to the camera controls.
  let isForwarding = false;
  // Grabbed point in the object frame, if the object is pulled.
  let pulledPoint: [number, number, number] | null = null;

  const setRay = (event: PointerEvent) => {
    const box = canvas.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * 2 - 1;
    const y = 1 - ((event.clientY - box.top) / box.height) * 2;
    raycaster.setFromCamera(new Vector2(x, y), target.camera);
  };

  const isOver = (event: PointerEvent) => {
    const { bounds, group } = target.object;
    if (!bounds || !(target.canMove() || target.canPull(event.ctrlKey))) return false;
    setRay(event);
    const ray = raycaster.ray.clone().applyMatrix4(group.matrixWorld.clone().invert());
    return ray.intersectBox(bounds, hit) !== null;
  };

  // Capture phase: runs before the listener of the camera controls, which would start to orbit.
  canvas.addEventListener(
    "pointerdown",
    (event) => {
      if (isForwarding) return;
      // A second finger zooms: it ends the drag, and the camera controls receive the first finger too.
      if (startEvent && !event.isPrimary) {
        const first = startEvent;
        release(first.pointerId);
        isForwarding = true;
        canvas.dispatchEvent(new PointerEvent(first.type, first));
        isForwarding = false;
      }
      if (event.button !== 0 || !event.isPrimary || startEvent || !isOver(event)) return;
      event.stopImmediatePropagation();
      const { matrixWorld, position } = target.object.group;
      pulledPoint = target.canPull(event.ctrlKey) ? [hit.x, hit.y, hit.z] : null;
      hit.applyMatrix4(matrixWorld);
      // Through the grabbed point, so that it stays under the pointer: parallel to the table, or to the image
      // for a pull.
      if (pulledPoint) plane.setFromNormalAndCoplanarPoint(target.camera.getWorldDirection(new Vector3()), hit);
      else plane.set(new Vector3(0, 0, 1), -hit.z);
      offset.subVectors(hit, position);
      startEvent = event;
      hasMoved = event.pointerType !== "touch";
      canvas.setPointerCapture(event.pointerId);
      target.onGrab(true);
    },
    { capture: true },
  );

  canvas.addEventListener("pointermove", (event) => {
    if (!startEvent) {
      if (event.pointerType === "mouse") canvas.style.cursor = isOver(event) ? "grab" : "";
      return;
    }
    if (event.pointerId !== startEvent.pointerId) return;
    if (!pulledPoint && !target.canMove()) return release(event.pointerId);
    hasMoved ||= Math.hypot(event.clientX - startEvent.clientX, event.clientY - startEvent.clientY) >= TOUCH_SLOP;
    if (!hasMoved) return;
    setRay(event);
    if (!raycaster.ray.intersectPlane(plane, hit)) return;
    if (pulledPoint) return target.onPull({ point: pulledPoint, target: [hit.x, hit.y, hit.z] });
    hit.sub(offset);
    target.onMove(clamp(hit.x, workspace.x), clamp(hit.y, workspace.y));
  });

  const release = (id: number) => {
    if (id !== startEvent?.pointerId) return;
    startEvent = null;
    if (pulledPoint) target.onPull(null);
    pulledPoint = null;
    target.onGrab(false);
  };
  canvas.addEventListener("pointerup", (event) => release(event.pointerId));
  canvas.addEventListener("pointercancel", (event) => release(event.pointerId));
}

function clamp(value: number, [min, max]: [number, number]): number {
  return Math.min(max, Math.max(min, value));
}
