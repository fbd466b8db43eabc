// 3-D view of the scene. Frames are rendered on demand: after a change, and while something moves.

import { BasicShadowMap, type Group, PCFShadowMap, Scene, WebGLRenderer } from "three";
import type { Cloud, Drag, Frame, ObjectLoaded, Phase, PlanarPose, Ready } from "../worker/protocol";
import { AdaptiveResolution } from "./adaptive_resolution";
import { clear, ObjectBody, robotBodies } from "./bodies";
import { OrbitCamera, type Preset } from "./camera";
import { Canvas2dRenderer } from "./canvas2d_renderer";
import { PointCloud, SensorFrustum } from "./cloud";
import { type Colors, onColorsChange, readColors } from "./colors";
import { ContactForces } from "./contact_forces";
import { dragObject } from "./drag";
import { DragSpring } from "./drag_spring";
import { Environment } from "./environment";
import { FrameScheduler } from "./frame_scheduler";
import { Ghost } from "./ghost";
import { JointLimitHighlight } from "./joint_limit_highlight";
import { PalmTrail } from "./palm_trail";
import { PoseInterpolator } from "./pose_interpolation";

export type Layer = "cloud" | "reconstruction" | "hulls" | "forces" | "trail" | "target" | "limits" | "sensor";

// Phases in which the hand can touch the object.
const CONTACT_PHASES: Phase[] = ["policy", "lift", "hold"];

// Camera rotation per key press (rad, right and up), and zoom per key press (fraction of the distance).
const ROTATION = Math.PI / 24;
const ROTATION_KEYS: Record<string, [number, number]> = {
  "Shift+ArrowLeft": [-ROTATION, 0],
  "Shift+ArrowRight": [ROTATION, 0],
  "Shift+ArrowUp": [0, ROTATION],
  "Shift+ArrowDown": [0, -ROTATION],
};
const ZOOM_KEYS: Record<string, number> = { "+": 0.1, "=": 0.1, "-": -0.1 };

// Delay from the last movement to a frame at full resolution (ms).
const IDLE_DELAY_MS = 300;

export interface ViewEvents {
  place(pose: PlanarPose): void;
  drag(drag: Drag | null): void;
  // The WebGL context was lost (false) or restored (true).
  contextChanged(isAvailable: boolean): void;
  // WebGL is not available; the 2-D renderer is used.
  fellBackTo2d(why: string): void;
  // The camera has moved.
  viewChanged(numbers: number[]): void;
  // The user has moved the camera.
  userMoved(): void;
}

export class View {
  readonly #canvas: HTMLCanvasElement;
  readonly #events: ViewEvents;
  // Software rendering: simpler shading and lower resolution keep the frame rate acceptable.
  readonly #isSoftware = usesSoftwareRendering();
  readonly #renderer: WebGLRenderer | Canvas2dRenderer;
  readonly #scene = new Scene();
  readonly #camera: OrbitCamera;
  readonly #object = new ObjectBody();
  readonly #cloud = new PointCloud();
  readonly #reconstruction = new PointCloud();
  readonly #forces = new ContactForces();
  readonly #trail = new PalmTrail();
  readonly #spring = new DragSpring();
  readonly #ghost = new Ghost();
  readonly #limits = new JointLimitHighlight();
  readonly #interpolator = new PoseInterpolator();
  readonly #resolution = new AdaptiveResolution(this.#isSoftware);
  readonly #scheduler = new FrameScheduler(this.#isSoftware);
  #environment: Environment | null = null;
  #sensor: SensorFrustum | null = null;
  #robot: Group[] = [];
  #frame: Frame | null = null;
  // Object pose at which the cloud was captured.
  #cloudPose: PlanarPose | null = null;
  // Camera of the last rendered frame.
  #lastView: number[] = [];
  #showsSensor = false;
  #isFrameRequested = false;
  // While the canvas is recorded, every frame is rendered, in a constant resolution.
  #isRecorded = false;
  #idleTimer = 0;

  // Throws if the browser supports neither WebGL nor a 2-D canvas.
  constructor(canvas: HTMLCanvasElement, events: ViewEvents) {
    this.#canvas = canvas;
    this.#events = events;
    this.#renderer = this.#makeRenderer();
    this.#camera = new OrbitCamera(canvas, () => this.#requestFrame(), () => events.userMoved());
    this.#reconstruction.points.visible = false;
    const lines = [this.#forces.group, this.#trail.mesh, this.#spring.line];
    this.#scene.add(this.#object.group, this.#cloud.points, this.#reconstruction.points, this.#ghost.group, ...lines);
    this.#object.group.visible = false;

    new ResizeObserver(() => this.#resize()).observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      events.contextChanged(false);
    });
    canvas.addEventListener("webglcontextrestored", () => {
      events.contextChanged(true);
      this.#requestFrame();
    });
    onColorsChange(() => this.#applyColors());
    this.#resize();
    this.#applyColors();
  }

  #makeRenderer(): WebGLRenderer | Canvas2dRenderer {
    const canvas = this.#canvas;
    try {
      const renderer = new WebGLRenderer({ canvas, antialias: !this.#isSoftware, powerPreference: "high-performance" });
      renderer.shadowMap.enabled = true;
      renderer.shadowMap.type = this.#isSoftware ? BasicShadowMap : PCFShadowMap;
      return renderer;
    } catch (error) {
      const renderer = new Canvas2dRenderer(canvas);
      this.#events.fellBackTo2d(String(error));
      return renderer;
    }
  }

  show(ready: Ready): void {
    const previous = [...this.#robot, this.#environment?.group, this.#sensor?.group].filter((group) => group !== undefined);
    this.#scene.remove(...previous);
    previous.forEach(clear);
    const isFirst = this.#environment === null;

    this.#robot = robotBodies(ready.links);
    this.#ghost.show(this.#robot);
    this.#limits.show(this.#robot, ready.joints);
    this.#environment = new Environment(ready.table, ready.workspace, this.#isSoftware);
    this.#sensor = new SensorFrustum(ready.camera);
    this.#camera.scene = ready;
    this.#scene.add(...this.#robot, this.#environment.group, this.#sensor.group);
    if (isFirst) {
      this.#makeDraggable(ready);
      this.#camera.goTo("home", 0, true);
    }
    this.#applyColors();
  }

  showObject(loaded: ObjectLoaded): void {
    this.#object.show(loaded);
    this.#object.group.visible = true;
    this.#clearCloud();
  }

  showCloud({ points, reconstruction }: Pick<Cloud, "points" | "reconstruction">): void {
    this.#cloud.show(points);
    this.#reconstruction.show(reconstruction);
    this.#cloudPose = this.#frame?.pose ?? null;
    this.#requestFrame();
  }

  clearReconstruction(): void {
    this.#reconstruction.show(new Float32Array(0));
    this.#requestFrame();
  }

  #clearCloud(): void {
    this.showCloud({ points: new Float32Array(0), reconstruction: new Float32Array(0) });
  }

  showFrame(frame: Frame): void {
    const now = performance.now();
    if (frame.running) this.#interpolator.moveTo(frame.poses, now);
    else this.#interpolator.jumpTo(frame.poses, now);
    const isOutdated = frame.phase !== "idle" && frame.phase !== "approach" && frame.phase !== "policy";
    for (const cloud of [this.#cloud, this.#reconstruction]) cloud.fade(isOutdated);
    this.#ghost.showFrame(frame, now);
    this.#limits.showFrame(frame);
    this.#forces.show(frame.contacts);
    this.#trail.show(frame);
    this.#frame = frame;
    // The cloud is removed once the object has been moved.
    if (frame.phase === "idle" && !isSame(this.#cloudPose, frame.pose)) this.#clearCloud();
    this.#requestFrame();
  }

  setLayer(layer: Layer, on: boolean): void {
    if (layer === "cloud") this.#cloud.points.visible = on;
    if (layer === "reconstruction") this.#reconstruction.points.visible = on;
    if (layer === "forces") this.#forces.group.visible = on;
    if (layer === "hulls") this.#object.showHulls(on);
    if (layer === "trail") this.#trail.mesh.visible = on;
    if (layer === "target") this.#ghost.group.visible = on;
    if (layer === "limits") this.#limits.isVisible = on;
    if (layer === "sensor") this.#showsSensor = on;
    this.#requestFrame();
  }

  goTo(preset: Preset): void {
    this.#camera.goTo(preset, performance.now());
    this.#requestFrame();
  }

  // Orbits or zooms by a key; returns whether the key was used.
  moveByKey(key: string): boolean {
    const rotation = ROTATION_KEYS[key];
    const fraction = ZOOM_KEYS[key];
    if (rotation) this.#camera.rotate(...rotation);
    else if (fraction) this.#camera.zoom(fraction);
    else return false;
    this.#requestFrame();
    return true;
  }

  // Camera position, then orbit target.
  getView(): number[] {
    return this.#camera.getView();
  }

  setView(numbers: number[]): void {
    this.#camera.setView(numbers);
    this.#requestFrame();
  }

  #reportView(): void {
    const view = this.#camera.getView();
    if (view.every((number, i) => number === this.#lastView[i])) return;
    this.#lastView = view;
    this.#events.viewChanged(view);
  }

  screenshot(): Promise<Blob | null> {
    this.#render(performance.now());
    return new Promise((resolve) => this.#canvas.toBlob(resolve, "image/png"));
  }

  // A canvas stream has no frame while nothing is rendered, and a film has one size.
  setRecorded(on: boolean): void {
    this.#isRecorded = on;
    // The first recorded frame has the size of the later ones.
    if (on) this.#render(performance.now(), this.#resolution.current);
    else this.#requestFrame();
  }

  #makeDraggable({ workspace }: Ready): void {
    dragObject(this.#canvas, workspace, {
      camera: this.#camera.camera,
      object: this.#object,
      canMove: () => this.#frame?.phase === "idle" || this.#frame?.phase === "outcome",
      canPull: (hasModifier) => {
        const phase = this.#frame?.phase ?? "idle";
        return CONTACT_PHASES.includes(phase) || (phase === "outcome" && hasModifier);
      },
      onPull: (drag) => {
        this.#spring.set(drag);
        this.#events.drag(drag);
        this.#requestFrame();
      },
      onGrab: (on) => {
        this.#environment?.highlightWorkspace(on);
        this.#canvas.style.cursor = on ? "grabbing" : "";
        this.#requestFrame();
      },
      onMove: (x, y) => {
        if (this.#frame) this.#events.place({ x, y, yaw: this.#frame.pose.yaw });
      },
    });
  }

  #applyColors(): void {
    const colors: Colors = readColors();
    this.#scene.background = colors.ground;
    const bodies = [this.#environment, this.#sensor, this.#object, this.#ghost, this.#limits];
    const overlays = [this.#cloud, this.#forces, this.#trail, this.#spring];
    for (const part of [...bodies, ...overlays]) part?.setColors(colors);
    this.#reconstruction.setColors({ ...colors, cloud: colors.reconstruction });
    this.#requestFrame();
  }

  #resize(): void {
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    if (width === 0 || height === 0) return;
    this.#renderer.setSize(width, height, false);
    this.#camera.resize(width, height, this.#coveredHeight());
    // A resized canvas is cleared, so it is rendered before it is displayed.
    this.#render(performance.now(), this.#resolution.current);
  }

  // Height of the canvas that the dock covers from below (CSS pixels).
  #coveredHeight(): number {
    const dock = document.querySelector(".dock")?.getBoundingClientRect();
    return dock ? Math.max(0, this.#canvas.getBoundingClientRect().bottom - dock.top) : 0;
  }

  #requestFrame(): void {
    if (this.#isFrameRequested) return;
    this.#isFrameRequested = true;
    const requested = performance.now();
    const render = () => {
      const now = performance.now();
      if (this.#scheduler.shouldDefer(now)) return void requestAnimationFrame(render);
      this.#isFrameRequested = false;
      this.#render(now, this.#isRecorded ? this.#resolution.current : this.#resolution.update(requested, now));
    };
    requestAnimationFrame(render);
  }

  // Renders at a fraction of the screen's resolution (per axis), and at the final resolution once nothing
  // moves.
  #render(now: number, fraction = 1): void {
    const ratio = fraction * Math.min(devicePixelRatio, 2);
    if (ratio !== this.#renderer.getPixelRatio()) this.#renderer.setPixelRatio(ratio);
    const isMoving = this.#interpolator.apply([...this.#robot, this.#object.group], now);
    const isGhostMoving = this.#ghost.apply(now);
    this.#spring.follow(this.#object.group);
    const isCameraMoving = this.#camera.update(now);
    this.#reportView();
    this.#sensor?.show(this.#showsSensor, this.#camera.camera.position);
    this.#environment?.updateShadows(fraction >= 1);
    this.#renderer.render(this.#scene, this.#camera.camera);
    this.#canvas.dataset["drawn"] = String(this.#robot.length);
    if (isMoving || isGhostMoving || isCameraMoving || this.#isRecorded) this.#requestFrame();
    clearTimeout(this.#idleTimer);
    if (this.#isRecorded) return;
    // Without antialiasing, two pixels per CSS pixel smooth the edges. A page that is zoomed out is displayed with
    // fewer.
    const final = this.#isSoftware && devicePixelRatio >= 1 ? 2 / Math.min(devicePixelRatio, 2) : 1;
    if (fraction < final) this.#idleTimer = window.setTimeout(() => this.#render(performance.now(), final), IDLE_DELAY_MS);
  }
}

// Whether WebGL runs on the CPU. There, antialiasing alone would halve the frame rate.
function usesSoftwareRendering(): boolean {
  const probe = document.createElement("canvas").getContext("webgl2");
  const info = probe?.getExtension("WEBGL_debug_renderer_info");
  const name = probe && info ? String(probe.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|basic render/i.test(name);
}

function isSame(a: PlanarPose | null, b: PlanarPose): boolean {
  return a !== null && a.x === b.x && a.y === b.y && a.yaw === b.yaw;
}
