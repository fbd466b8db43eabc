// Light, ground, table and the robot's plinth: everything that never moves.

import {
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  CylinderGeometry,
  DirectionalLight,
  Group,
  HemisphereLight,
  LineBasicMaterial,
  LineLoop,
  Mesh,
  MeshLambertMaterial,
  ShadowMaterial,
} from "three";
import { RoundedBoxGeometry } from "three/examples/jsm/geometries/RoundedBoxGeometry.js";
import type { Box, Rectangle } from "../protocol";
import type { Colors } from "./colors";

const SHADOW_REACH = 1.1;
const ROUNDING = 0.012;

export class Studio {
  readonly group = new Group();
  readonly #table = new MeshLambertMaterial();
  readonly #plinth = new MeshLambertMaterial();
  readonly #outline = new LineBasicMaterial({ transparent: true });
  readonly #shadow = new ShadowMaterial();
  readonly #sky = new HemisphereLight();
  readonly #key: DirectionalLight;
  readonly #rim = new DirectionalLight();
  readonly #isPlain: boolean;
  #pictures = 0;

  // Shadows are coarser in a plain studio, and follow every second picture.
  constructor(table: Box, workspace: Rectangle, isPlain: boolean) {
    this.#isPlain = isPlain;
    this.#key = keyLight(table, isPlain ? 1024 : 2048);
    this.#key.shadow.autoUpdate = !isPlain;
    this.#rim.position.set(1.2, 1.6, 1.2);
    this.group.add(this.#sky, this.#key, this.#rim, this.#tabletop(table), this.#foot(table), this.#floor(table));
    this.group.add(this.#area(workspace, table.center[2] + table.half[2]));
    this.highlight(false);
  }

  paint(colors: Colors): void {
    this.#table.color = colors.table;
    this.#plinth.color = colors.plinth;
    this.#outline.color = colors.line;
    this.#sky.color = colors.sky;
    this.#sky.groundColor = colors.plinth;
    this.#sky.intensity = 1.3 * colors.light;
    this.#key.intensity = 1.75 * colors.light;
    this.#rim.intensity = 0.45 * colors.light;
    this.#shadow.opacity = colors.shadow;
  }

  // Before every picture; a last one of what rests has shadows of its own.
  castShadows(isLast: boolean): void {
    this.#pictures += 1;
    this.#key.shadow.needsUpdate = this.#isPlain && (isLast || this.#pictures % 2 === 0);
  }

  // Shows where the object may stand.
  highlight(on: boolean): void {
    this.#outline.opacity = on ? 1 : 0.4;
  }

  #tabletop({ center, half }: Box): Mesh {
    const [x, y, z] = half.map((side) => 2 * side) as [number, number, number];
    const mesh = new Mesh(new RoundedBoxGeometry(x, y, z, 4, ROUNDING), this.#table);
    mesh.position.set(...center);
    mesh.castShadow = mesh.receiveShadow = true;
    return mesh;
  }

  // The robot stands at the origin, the table beside it, both on one floor.
  #foot({ center, half }: Box): Mesh {
    const height = half[2] - center[2];
    const shape = new CylinderGeometry(0.125, 0.14, height, 64).rotateX(Math.PI / 2);
    const mesh = new Mesh(shape, this.#plinth);
    mesh.position.z = -height / 2;
    mesh.castShadow = mesh.receiveShadow = true;
    return mesh;
  }

  // Only the shadows on it are drawn, so that it runs into the background without an edge.
  #floor({ center, half }: Box): Mesh {
    const mesh = new Mesh(new CircleGeometry(4, 48), this.#shadow);
    // Above the rounded edge, under which light would show.
    mesh.position.set(center[0], center[1], center[2] - half[2] + ROUNDING);
    mesh.receiveShadow = true;
    return mesh;
  }

  #area({ x, y }: Rectangle, top: number): LineLoop {
    const z = top + 0.001;
    const corners = [x[0], y[0], z, x[1], y[0], z, x[1], y[1], z, x[0], y[1], z];
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(corners), 3));
    return new LineLoop(geometry, this.#outline);
  }
}

function keyLight({ center }: Box, texels: number): DirectionalLight {
  const light = new DirectionalLight();
  const [x, y, z] = center;
  light.position.set(x - 0.45, y - 1.35, z + 2.5);
  light.target.position.set(x - 0.2, y, z + 0.25);
  light.target.updateMatrixWorld();
  light.castShadow = true;
  light.shadow.mapSize.set(texels, texels);
  light.shadow.radius = 5;
  light.shadow.normalBias = 0.012;
  light.shadow.bias = -0.0004;
  const view = light.shadow.camera;
  view.left = view.bottom = -SHADOW_REACH;
  view.right = view.top = SHADOW_REACH;
  view.near = 0.5;
  view.far = 6;
  return light;
}
