// The picture: a renderer that draws when something has changed, and rests otherwise.

import { BasicShadowMap, type Group, PCFShadowMap, Scene, WebGLRenderer } from "three";
import type { Cloud as Seen, Frame, ObjectLoaded, Phase, PlanarPose, Pull, Ready } from "../protocol";
import { clear, robotBodies, Thing } from "./bodies";
import { type Preset, Viewpoint } from "./camera";
import { Cloud, Sensor } from "./cloud";
import { type Colors, onColorsChange, readColors } from "./colors";
import { dragObject } from "./drag";
import { Forces } from "./forces";
import { Ghost } from "./ghost";
import { Limits } from "./limits";
import { Motion } from "./motion";
import { Precedence } from "./precedence";
import { Sharpness } from "./sharpness";
import { Sketch } from "./sketch";
import { Spring } from "./spring";
import { Studio } from "./studio";
import { Trail } from "./trail";

export type Layer = "cloud" | "reconstruction" | "hulls" | "forces" | "trail" | "target" | "limits" | "sensor";

// While the hand has to do with the object.
const ACTS: Phase[] = ["policy", "lift", "hold"];

// What a key turns the viewer by (rad, to the right and up), or takes it nearer by.
const TURN = Math.PI / 24;
const TURNS: Record<string, [number, number]> = {
  "Shift+ArrowLeft": [-TURN, 0],
  "Shift+ArrowRight": [TURN, 0],
  "Shift+ArrowUp": [0, TURN],
  "Shift+ArrowDown": [0, -TURN],
};
const NEARER: Record<string, number> = { "+": 0.1, "=": 0.1, "-": -0.1 };

// What has not moved for so long rests (milliseconds).
const REST = 300;

export interface ViewEvents {
  place(pose: PlanarPose): void;
  pull(pull: Pull | null): void;
  // The graphics were lost (false) or came back (true).
  graphics(works: boolean): void;
  // There is no WebGL: the picture is a sketch.
  sketched(why: string): void;
  // The viewer stands or looks elsewhere.
  moved(stand: number[]): void;
  // Somebody looks elsewhere by hand or key.
  taken(): void;
}

export class View {
  readonly #canvas: HTMLCanvasElement;
  readonly #events: ViewEvents;
  // Pictures are the processor's work: less is drawn, so that they come often enough.
  readonly #isPlain = isDrawnByProcessor();
  readonly #renderer: WebGLRenderer | Sketch;
  readonly #scene = new Scene();
  readonly #viewpoint: Viewpoint;
  readonly #thing = new Thing();
  readonly #cloud = new Cloud();
  readonly #reconstruction = new Cloud();
  readonly #forces = new Forces();
  readonly #trail = new Trail();
  readonly #spring = new Spring();
  readonly #ghost = new Ghost();
  readonly #limits = new Limits();
  readonly #motion = new Motion();
  readonly #sharpness = new Sharpness(this.#isPlain);
  readonly #precedence = new Precedence(this.#isPlain);
  #studio: Studio | null = null;
  #sensor: Sensor | null = null;
  #robot: Group[] = [];
  #frame: Frame | null = null;
  // Where the object stood when it was looked at.
  #seenAt: PlanarPose | null = null;
  // Where the viewer stood in the last picture.
  #stood: number[] = [];
  #showsSensor = false;
  #isAwake = false;
  #rest = 0;

  // Throws where nothing can be drawn.
  constructor(canvas: HTMLCanvasElement, events: ViewEvents) {
    this.#canvas = canvas;
    this.#events = events;
    this.#renderer = this.#begin();
    this.#viewpoint = new Viewpoint(canvas, () => this.#wake(), () => events.taken());
    this.#reconstruction.points.visible = false;
    const lines = [this.#forces.lines, this.#trail.line, this.#spring.line];
    this.#scene.add(this.#thing.group, this.#cloud.points, this.#reconstruction.points, this.#ghost.group, ...lines);
    this.#thing.group.visible = false;

    new ResizeObserver(() => this.#resize()).observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      events.graphics(false);
    });
    canvas.addEventListener("webglcontextrestored", () => {
      events.graphics(true);
      this.#wake();
    });
    onColorsChange(() => this.#paint());
    this.#resize();
    this.#paint();
  }

  #begin(): WebGLRenderer | Sketch {
    const canvas = this.#canvas;
    try {
      const renderer = new WebGLRenderer({ canvas, antialias: !this.#isPlain, powerPreference: "high-performance" });
      renderer.shadowMap.enabled = true;
      renderer.shadowMap.type = this.#isPlain ? BasicShadowMap : PCFShadowMap;
      return renderer;
    } catch (error) {
      const sketch = new Sketch(canvas);
      this.#events.sketched(String(error));
      return sketch;
    }
  }

  show(ready: Ready): void {
    const before = [...this.#robot, this.#studio?.group, this.#sensor?.group].filter((group) => group !== undefined);
    this.#scene.remove(...before);
    before.forEach(clear);
    const isFirst = this.#studio === null;

    this.#robot = robotBodies(ready.links);
    this.#ghost.show(this.#robot);
    this.#limits.show(this.#robot, ready.joints);
    this.#studio = new Studio(ready.table, ready.workspace, this.#isPlain);
    this.#sensor = new Sensor(ready.camera);
    this.#viewpoint.scene = ready;
    this.#scene.add(...this.#robot, this.#studio.group, this.#sensor.group);
    if (isFirst) {
      this.#makeDraggable(ready);
      this.#viewpoint.goTo("home", 0, true);
    }
    this.#paint();
  }

  showObject(loaded: ObjectLoaded): void {
    this.#thing.show(loaded);
    this.#thing.group.visible = true;
    this.#clearCloud();
  }

  showCloud({ points, reconstruction }: Pick<Seen, "points" | "reconstruction">): void {
    this.#cloud.show(points);
    this.#reconstruction.show(reconstruction);
    this.#seenAt = this.#frame?.pose ?? null;
    this.#wake();
  }

  forgetReconstruction(): void {
    this.#reconstruction.show(new Float32Array(0));
    this.#wake();
  }

  #clearCloud(): void {
    this.showCloud({ points: new Float32Array(0), reconstruction: new Float32Array(0) });
  }

  showFrame(frame: Frame): void {
    const now = performance.now();
    if (frame.running) this.#motion.moveTo(frame.poses, now);
    else this.#motion.jumpTo(frame.poses, now);
    const isMemory = frame.phase !== "idle" && frame.phase !== "approach" && frame.phase !== "policy";
    for (const cloud of [this.#cloud, this.#reconstruction]) cloud.fade(isMemory);
    this.#ghost.follow(frame, now);
    this.#limits.follow(frame);
    this.#forces.show(frame.contacts);
    this.#trail.show(frame);
    this.#frame = frame;
    // An object that was moved since is no longer where the cloud is.
    if (frame.phase === "idle" && !isSame(this.#seenAt, frame.pose)) this.#clearCloud();
    this.#wake();
  }

  setLayer(layer: Layer, on: boolean): void {
    if (layer === "cloud") this.#cloud.points.visible = on;
    if (layer === "reconstruction") this.#reconstruction.points.visible = on;
    if (layer === "forces") this.#forces.lines.visible = on;
    if (layer === "hulls") this.#thing.showHulls(on);
    if (layer === "trail") this.#trail.line.visible = on;
    if (layer === "target") this.#ghost.group.visible = on;
    if (layer === "limits") this.#limits.on = on;
    if (layer === "sensor") this.#showsSensor = on;
    this.#wake();
  }

  look(preset: Preset): void {
    this.#viewpoint.goTo(preset, performance.now());
    this.#wake();
  }

  // Turns the viewer about what is looked at, or takes it nearer, by a key.
  step(key: string): boolean {
    const turn = TURNS[key];
    const share = NEARER[key];
    if (turn) this.#viewpoint.turn(...turn);
    else if (share) this.#viewpoint.approach(share);
    else return false;
    this.#wake();
    return true;
  }

  // Where the viewer stands and looks.
  stand(): number[] {
    return this.#viewpoint.stand();
  }

  #tellStand(): void {
    const stand = this.#viewpoint.stand();
    if (stand.every((number, i) => number === this.#stood[i])) return;
    this.#stood = stand;
    this.#events.moved(stand);
  }

  standAt(numbers: number[]): void {
    this.#viewpoint.standAt(numbers);
    this.#wake();
  }

  // What is shown, as a picture.
  picture(): Promise<Blob | null> {
    this.#draw(performance.now());
    return new Promise((resolve) => this.#canvas.toBlob(resolve, "image/png"));
  }

  #makeDraggable({ workspace }: Ready): void {
    dragObject(this.#canvas, workspace, {
      camera: this.#viewpoint.camera,
      thing: this.#thing,
      isFree: () => this.#frame?.phase === "idle" || this.#frame?.phase === "verdict",
      isPullable: (asked) => {
        const phase = this.#frame?.phase ?? "idle";
        return ACTS.includes(phase) || (phase === "verdict" && asked);
      },
      pulled: (pull) => {
        this.#spring.set(pull);
        this.#events.pull(pull);
        this.#wake();
      },
      grabbed: (on) => {
        this.#studio?.highlight(on);
        this.#canvas.style.cursor = on ? "grabbing" : "";
        this.#wake();
      },
      moved: (x, y) => {
        if (this.#frame) this.#events.place({ x, y, yaw: this.#frame.pose.yaw });
      },
    });
  }

  #paint(): void {
    const colors: Colors = readColors();
    this.#scene.background = colors.ground;
    const painted = [this.#studio, this.#sensor, this.#thing, this.#cloud, this.#forces, this.#trail, this.#spring, this.#ghost, this.#limits];
    for (const one of painted) one?.paint(colors);
    this.#reconstruction.paint({ ...colors, cloud: colors.reconstruction });
    this.#wake();
  }

  #resize(): void {
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    if (width === 0 || height === 0) return;
    this.#renderer.setSize(width, height, false);
    this.#viewpoint.resize(width, height, this.#covered());
    // A resized canvas is empty: it is filled before it is shown.
    this.#draw(performance.now(), this.#sharpness.last);
  }

  // How much of the canvas's foot lies under the dock (CSS pixels).
  #covered(): number {
    const dock = document.querySelector(".dock")?.getBoundingClientRect();
    return dock ? Math.max(0, this.#canvas.getBoundingClientRect().bottom - dock.top) : 0;
  }

  #wake(): void {
    if (this.#isAwake) return;
    this.#isAwake = true;
    const wanted = performance.now();
    const draw = () => {
      const now = performance.now();
      if (this.#precedence.waits(now)) return void requestAnimationFrame(draw);
      this.#isAwake = false;
      this.#draw(now, this.#sharpness.share(wanted, now));
    };
    requestAnimationFrame(draw);
  }

  // Draws with a share of the screen's pixels along a side, and as finely as it may be once nothing moves.
  #draw(now: number, share = 1): void {
    const ratio = share * Math.min(devicePixelRatio, 2);
    if (ratio !== this.#renderer.getPixelRatio()) this.#renderer.setPixelRatio(ratio);
    const isMoving = this.#motion.apply([...this.#robot, this.#thing.group], now);
    const isGhostMoving = this.#ghost.apply(now);
    this.#spring.follow(this.#thing.group);
    const isTurning = this.#viewpoint.update(now);
    this.#tellStand();
    this.#sensor?.show(this.#showsSensor, this.#viewpoint.camera.position);
    this.#studio?.castShadows(share >= 1);
    this.#renderer.render(this.#scene, this.#viewpoint.camera);
    this.#canvas.dataset["drawn"] = String(this.#robot.length);
    if (isMoving || isGhostMoving || isTurning) this.#wake();
    clearTimeout(this.#rest);
    // Twice as many pixels along a side as an ordinary screen has do for smoothed edges.
    const finest = this.#isPlain ? Math.max(1, 2 / Math.min(devicePixelRatio, 2)) : 1;
    if (share < finest) this.#rest = window.setTimeout(() => this.#draw(performance.now(), finest), REST);
  }
}

// Whether there are no graphics but the processor: smooth edges alone would halve the pictures a second there.
function isDrawnByProcessor(): boolean {
  const probe = document.createElement("canvas").getContext("webgl2");
  const names = probe?.getExtension("WEBGL_debug_renderer_info");
  const name = probe && names ? String(probe.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|basic render/i.test(name);
}

function isSame(a: PlanarPose | null, b: PlanarPose): boolean {
  return a !== null && a.x === b.x && a.y === b.y && a.yaw === b.yaw;
}
