// Fallback renderer without WebGL: draws the convex outline of each mesh on a 2-D canvas, back to front.

import {
  type BufferGeometry,
  Color,
  InstancedMesh,
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

// Directions whose extreme vertices represent a mesh; their convex outline is drawn.
const NUM_DIRECTIONS = 160;
// Distance of the near plane (m).
const NEAR = 0.05;
// Brightness of edges relative to faces.
const EDGE_BRIGHTNESS = 0.6;

// Right and down (pixels).
type ImagePoint = [number, number];

interface DrawItem {
  // Distance of the farthest vertex (m), so that the table is drawn before the objects on it; 0 without depth
  // test.
  depth: number;
  draw: () => void;
}

export class Canvas2dRenderer {
  readonly #canvas: HTMLCanvasElement;
  readonly #context: CanvasRenderingContext2D;
  readonly #extremeVertices = new WeakMap<BufferGeometry, Float32Array>();
  readonly #view = new Matrix4();
  readonly #instance = new Matrix4();
  readonly #point = new Vector3();
  #ratio = 1;
  #width = 1;
  #height = 1;
  // Focal length (pixels).
  #focalLength = 1;

  // Throws if there is no 2-D context.
  constructor(canvas: HTMLCanvasElement) {
    const context = canvas.getContext("2d");
    if (!context) throw new Error("this browser supports neither WebGL nor a 2-D canvas");
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
    this.#focalLength = (camera.projectionMatrix.elements[5]! * this.#canvas.height) / 2;
    const items: DrawItem[] = [];
    scene.traverseVisible((object) => {
      this.#view.multiplyMatrices(camera.matrixWorldInverse, object.matrixWorld);
      const item = this.#drawItem(object, camera);
      if (item) items.push(item);
    });
    const context = this.#context;
    context.globalAlpha = 1;
    context.fillStyle = scene.background instanceof Color ? scene.background.getStyle() : "white";
    context.fillRect(0, 0, this.#canvas.width, this.#canvas.height);
    for (const { draw } of items.sort((a, b) => b.depth - a.depth)) draw();
  }

  #drawItem(object: Object3D, camera: PerspectiveCamera): DrawItem | null {
    if (object instanceof InstancedMesh) return this.#instancesItem(object, camera);
    if (object instanceof Mesh && !(object.material instanceof ShadowMaterial)) return this.#meshItem(object, camera);
    if (object instanceof Line || object instanceof Points) return this.#lineOrPointsItem(object, camera);
    return null;
  }

  #instancesItem(mesh: InstancedMesh, camera: PerspectiveCamera): DrawItem {
    const view = this.#view.clone();
    const items = Array.from({ length: mesh.count }, (_, i) => {
      mesh.getMatrixAt(i, this.#instance);
      this.#view.multiplyMatrices(view, this.#instance);
      return this.#meshItem(mesh, camera);
    });
    return { depth: Math.max(0, ...items.map(({ depth }) => depth)), draw: () => items.forEach(({ draw }) => draw()) };
  }

  #meshItem({ geometry, material }: Mesh, camera: PerspectiveCamera): DrawItem {
    const vertices = this.#extremeVertices.get(geometry) ?? extremeVertices(geometry);
    this.#extremeVertices.set(geometry, vertices);
    const { points, depth } = this.#project(vertices, vertices.length / 3, camera);
    const outline = convexOutline(points);
    const draw = () => {
      const color = this.#applyMaterial(material as Material);
      this.#context.fillStyle = color.getStyle();
      this.#trace(outline);
      this.#context.closePath();
      this.#context.fill();
      this.#context.strokeStyle = color.multiplyScalar(EDGE_BRIGHTNESS).getStyle();
      this.#context.stroke();
    };
    return { depth: depthOf(material as Material, depth), draw };
  }

  #lineOrPointsItem(object: Line | Points, camera: PerspectiveCamera): DrawItem | null {
    const position = object.geometry.getAttribute("position");
    if (!position) return null;
    const count = Math.min(position.count, object.geometry.drawRange.count);
    const { points, depth } = this.#project(position.array, count, camera);
    const material = object.material as Material;
    const draw = () => {
      const color = this.#applyMaterial(material).getStyle();
      const context = this.#context;
      [context.fillStyle, context.strokeStyle] = [color, color];
      if (object instanceof Points) {
        const side = 2 * this.#ratio;
        for (const [x, y] of points) context.fillRect(x - side / 2, y - side / 2, side, side);
      } else if (object instanceof LineSegments) {
        for (let i = 0; i + 1 < points.length; i += 2) {
          this.#trace(points.slice(i, i + 2));
          context.stroke();
        }
      } else {
        this.#trace(points);
        if (object instanceof LineLoop) context.closePath();
        context.stroke();
      }
    };
    return { depth: depthOf(material, depth), draw };
  }

  // Projects points into the image; `depth` is the distance of the farthest one (m).
  #project(positions: ArrayLike<number>, count: number, camera: PerspectiveCamera): { points: ImagePoint[]; depth: number } {
    const points: ImagePoint[] = [];
    let depth = 0;
    const { elements } = camera.projectionMatrix;
    const [cx, cy] = [this.#canvas.width / 2, this.#canvas.height / 2];
    // Offset of the principal point, from the camera's view offset.
    const [dx, dy] = [elements[8]! * cx, elements[9]! * cy];
    for (let i = 0; i < 3 * count; i += 3) {
      const { x, y, z } = this.#point.fromArray(positions, i).applyMatrix4(this.#view);
      const distance = Math.max(-z, NEAR);
      depth = Math.max(depth, distance);
      points.push([cx + (this.#focalLength * x) / distance - dx, cy - (this.#focalLength * y) / distance + dy]);
    }
    return { points, depth };
  }

  // Sets opacity and line style; returns the material's colour.
  #applyMaterial(material: Material): Color {
    this.#context.globalAlpha = material.transparent ? material.opacity : 1;
    this.#context.lineWidth = this.#ratio;
    this.#context.lineJoin = "round";
    return "color" in material && material.color instanceof Color ? material.color.clone() : new Color();
  }

  #trace(points: readonly ImagePoint[]): void {
    this.#context.beginPath();
    points.forEach(([x, y], i) => (i === 0 ? this.#context.moveTo(x, y) : this.#context.lineTo(x, y)));
  }
}

function depthOf(material: Material, depth: number): number {
  return material.depthTest ? depth : 0;
}

// Extreme vertices of a mesh in evenly distributed directions (Fibonacci sphere).
function extremeVertices(geometry: BufferGeometry): Float32Array {
  const position = geometry.getAttribute("position");
  if (!position) return new Float32Array(0);
  const { array } = position;
  const indices = new Set<number>();
  for (let k = 0; k < NUM_DIRECTIONS; k++) {
    const z = 1 - (2 * k + 1) / NUM_DIRECTIONS;
    const azimuth = Math.PI * (3 - Math.sqrt(5)) * k;
    const radius = Math.sqrt(1 - z * z);
    const [x, y] = [radius * Math.cos(azimuth), radius * Math.sin(azimuth)];
    let best = 0;
    let max = -Infinity;
    for (let i = 0; i < 3 * position.count; i += 3) {
      const distance = x * array[i]! + y * array[i + 1]! + z * array[i + 2]!;
      if (distance > max) [best, max] = [i, distance];
    }
    indices.add(best);
  }
  return new Float32Array([...indices].flatMap((i) => [array[i]!, array[i + 1]!, array[i + 2]!]));
}

// Convex hull in the image (Andrew's monotone chain).
function convexOutline(points: ImagePoint[]): ImagePoint[] {
  const sorted = [...points].sort(([ax, ay], [bx, by]) => ax - bx || ay - by);
  const half = (ordered: ImagePoint[]) => {
    const chain: ImagePoint[] = [];
    for (const point of ordered) {
      while (chain.length > 1 && !turnsLeft(chain[chain.length - 2]!, chain[chain.length - 1]!, point)) chain.pop();
      chain.push(point);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half([...sorted].reverse())];
}

function turnsLeft([ax, ay]: ImagePoint, [bx, by]: ImagePoint, [cx, cy]: ImagePoint): boolean {
  return (bx - ax) * (cy - ay) > (by - ay) * (cx - ax);
}
