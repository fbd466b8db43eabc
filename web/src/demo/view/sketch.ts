// The picture where there is no WebGL: the outline of every part, the far ones first, in a flat canvas.

import {
  type BufferGeometry,
  Color,
  Line,
  LineLoop,
  LineSegments,
  type Material,
  Matrix4,
  Mesh,
  type Object3D,
  type PerspectiveCamera,
  Points,
  type Scene,
  ShadowMaterial,
  Vector3,
} from "three";

// Directions in which the outermost corner of a part is kept: what is drawn is the outline of these.
const DIRECTIONS = 160;
// Nothing is seen nearer than this (m).
const NEAR = 0.05;
// How much of its colour an edge keeps.
const EDGE = 0.6;

// Right and down (pixels).
type Spot = [number, number];

interface Item {
  // Of its farthest corner (m): what stands on the table comes after it. What is seen through everything comes last.
  depth: number;
  draw: () => void;
}

export class Sketch {
  readonly #canvas: HTMLCanvasElement;
  readonly #context: CanvasRenderingContext2D;
  readonly #corners = new WeakMap<BufferGeometry, Float32Array>();
  readonly #view = new Matrix4();
  readonly #point = new Vector3();
  #ratio = 1;
  #width = 1;
  #height = 1;
  // Pixels that a metre has at a distance of one.
  #focus = 1;

  // Throws where there is no canvas either.
  constructor(canvas: HTMLCanvasElement) {
    const context = canvas.getContext("2d");
    if (!context) throw new Error("this browser draws no pictures");
    this.#canvas = canvas;
    this.#context = context;
  }

  getPixelRatio(): number {
    return this.#ratio;
  }

  setPixelRatio(ratio: number): void {
    this.#ratio = ratio;
    this.setSize(this.#width, this.#height);
  }

  setSize(width: number, height: number): void {
    [this.#width, this.#height] = [width, height];
    this.#canvas.width = Math.floor(width * this.#ratio);
    this.#canvas.height = Math.floor(height * this.#ratio);
  }

  render(scene: Scene, camera: PerspectiveCamera): void {
    scene.updateMatrixWorld();
    camera.updateMatrixWorld();
    this.#focus = (camera.projectionMatrix.elements[5]! * this.#canvas.height) / 2;
    const items: Item[] = [];
    scene.traverseVisible((object) => {
      this.#view.multiplyMatrices(camera.matrixWorldInverse, object.matrixWorld);
      const item = this.#item(object, camera);
      if (item) items.push(item);
    });
    const context = this.#context;
    context.globalAlpha = 1;
    context.fillStyle = scene.background instanceof Color ? scene.background.getStyle() : "white";
    context.fillRect(0, 0, this.#canvas.width, this.#canvas.height);
    for (const { draw } of items.sort((a, b) => b.depth - a.depth)) draw();
  }

  #item(object: Object3D, camera: PerspectiveCamera): Item | null {
    if (object instanceof Mesh && !(object.material instanceof ShadowMaterial)) return this.#part(object, camera);
    if (object instanceof Line || object instanceof Points) return this.#marks(object, camera);
    return null;
  }

  #part({ geometry, material }: Mesh, camera: PerspectiveCamera): Item {
    const corners = this.#corners.get(geometry) ?? outermost(geometry);
    this.#corners.set(geometry, corners);
    const { spots, depth } = this.#project(corners, corners.length / 3, camera);
    const shape = outline(spots);
    const draw = () => {
      const color = this.#take(material as Material);
      this.#context.fillStyle = color.getStyle();
      this.#trace(shape);
      this.#context.closePath();
      this.#context.fill();
      this.#context.strokeStyle = color.multiplyScalar(EDGE).getStyle();
      this.#context.stroke();
    };
    return { depth: depthOf(material as Material, depth), draw };
  }

  // A line, its segments, or points.
  #marks(object: Line | Points, camera: PerspectiveCamera): Item | null {
    const position = object.geometry.getAttribute("position");
    if (!position) return null;
    const count = Math.min(position.count, object.geometry.drawRange.count);
    const { spots, depth } = this.#project(position.array, count, camera);
    const material = object.material as Material;
    const draw = () => {
      const color = this.#take(material).getStyle();
      const context = this.#context;
      [context.fillStyle, context.strokeStyle] = [color, color];
      if (object instanceof Points) {
        const side = 2 * this.#ratio;
        for (const [x, y] of spots) context.fillRect(x - side / 2, y - side / 2, side, side);
      } else if (object instanceof LineSegments) {
        for (let i = 0; i + 1 < spots.length; i += 2) {
          this.#trace(spots.slice(i, i + 2));
          context.stroke();
        }
      } else {
        this.#trace(spots);
        if (object instanceof LineLoop) context.closePath();
        context.stroke();
      }
    };
    return { depth: depthOf(material, depth), draw };
  }

  // Where points of the object lie in the picture, and the distance of the farthest one.
  #project(positions: ArrayLike<number>, count: number, camera: PerspectiveCamera): { spots: Spot[]; depth: number } {
    const spots: Spot[] = [];
    let depth = 0;
    const { elements } = camera.projectionMatrix;
    const [right, down] = [this.#canvas.width / 2, this.#canvas.height / 2];
    // The picture's middle may lie beside that of what is looked at.
    const [across, up] = [elements[8]! * right, elements[9]! * down];
    for (let i = 0; i < 3 * count; i += 3) {
      const { x, y, z } = this.#point.fromArray(positions, i).applyMatrix4(this.#view);
      const away = Math.max(-z, NEAR);
      depth = Math.max(depth, away);
      spots.push([right + (this.#focus * x) / away - across, down - (this.#focus * y) / away + up]);
    }
    return { spots, depth };
  }

  // Sets how much of the material covers what lies behind, and gives its colour.
  #take(material: Material): Color {
    this.#context.globalAlpha = material.transparent ? material.opacity : 1;
    this.#context.lineWidth = this.#ratio;
    this.#context.lineJoin = "round";
    return "color" in material && material.color instanceof Color ? material.color.clone() : new Color();
  }

  #trace(spots: readonly Spot[]): void {
    this.#context.beginPath();
    spots.forEach(([x, y], i) => (i === 0 ? this.#context.moveTo(x, y) : this.#context.lineTo(x, y)));
  }
}

function depthOf(material: Material, depth: number): number {
  return material.depthTest ? depth : 0;
}

// The corners of a surface that lie farthest out, in directions that are spread evenly.
function outermost(geometry: BufferGeometry): Float32Array {
  const position = geometry.getAttribute("position");
  if (!position) return new Float32Array(0);
  const { array } = position;
  const chosen = new Set<number>();
  for (let k = 0; k < DIRECTIONS; k++) {
    const z = 1 - (2 * k + 1) / DIRECTIONS;
    const turn = Math.PI * (3 - Math.sqrt(5)) * k;
    const flat = Math.sqrt(1 - z * z);
    const [x, y] = [flat * Math.cos(turn), flat * Math.sin(turn)];
    let best = 0;
    let most = -Infinity;
    for (let i = 0; i < 3 * position.count; i += 3) {
      const along = x * array[i]! + y * array[i + 1]! + z * array[i + 2]!;
      if (along > most) [best, most] = [i, along];
    }
    chosen.add(best);
  }
  return new Float32Array([...chosen].flatMap((i) => [array[i]!, array[i + 1]!, array[i + 2]!]));
}

// The convex outline of spots (Andrew's monotone chain).
function outline(spots: Spot[]): Spot[] {
  const sorted = [...spots].sort(([ax, ay], [bx, by]) => ax - bx || ay - by);
  const half = (along: Spot[]) => {
    const kept: Spot[] = [];
    for (const spot of along) {
      while (kept.length > 1 && !turns(kept[kept.length - 2]!, kept[kept.length - 1]!, spot)) kept.pop();
      kept.push(spot);
    }
    return kept.slice(0, -1);
  };
  return [...half(sorted), ...half([...sorted].reverse())];
}

function turns([ax, ay]: Spot, [bx, by]: Spot, [cx, cy]: Spot): boolean {
  return (bx - ax) * (cy - ay) > (by - ay) * (cx - ax);
}
