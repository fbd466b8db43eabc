// Static environment: lights, floor, table, robot pedestal, outline of the workspace.

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
import type { Table, Rectangle } from "../worker/protocol";
import type { Colors } from "./colors";

// Half width of the shadow map's frustum, edge radius of the table (m).
const SHADOW_HALF_WIDTH = 1.1;
const EDGE_RADIUS = 0.012;

export class Environment {
  readonly group = new Group();
  readonly #tableMaterial = new MeshLambertMaterial();
  readonly #pedestalMaterial = new MeshLambertMaterial();
  readonly #outline = new LineBasicMaterial({ transparent: true });
  readonly #shadow = new ShadowMaterial();
  readonly #sky = new HemisphereLight();
  readonly #key: DirectionalLight;
  readonly #rim = new DirectionalLight();
  readonly #isSoftware: boolean;
  #frames = 0;

  // With software rendering, shadows are coarser and updated in every second frame.
  constructor(table: Table, workspace: Rectangle, isSoftware: boolean) {
    this.#isSoftware = isSoftware;
    this.#key = keyLight(table, isSoftware ? 1024 : 2048);
    this.#key.shadow.autoUpdate = !isSoftware;
    this.#rim.position.set(1.2, 1.6, 1.2);
    this.group.add(this.#sky, this.#key, this.#rim, this.#tabletop(table), this.#pedestal(table), this.#floor(table));
    this.group.add(this.#workspaceOutline(workspace, table.center[2] + table.half[2]));
    this.highlightWorkspace(false);
  }

  setColors(colors: Colors): void {
    this.#tableMaterial.color = colors.table;
    this.#pedestalMaterial.color = colors.plinth;
    this.#outline.color = colors.line;
    this.#sky.color = colors.sky;
    this.#sky.groundColor = colors.plinth;
    this.#sky.intensity = 1.3 * colors.light;
    this.#key.intensity = 1.75 * colors.light;
    this.#rim.intensity = 0.45 * colors.light;
    this.#shadow.opacity = colors.shadow;
  }

  // Called before every frame. The final frame of a scene at rest always updates the shadows.
  updateShadows(isFinal: boolean): void {
    this.#frames += 1;
    this.#key.shadow.needsUpdate = this.#isSoftware && (isFinal || this.#frames % 2 === 0);
  }

  // Emphasises the outline of the workspace.
  highlightWorkspace(on: boolean): void {
    this.#outline.opacity = on ? 1 : 0.4;
  }

  #tabletop({ center, half }: Table): Mesh {
    const [x, y, z] = half.map((side) => 2 * side) as [number, number, number];
    const mesh = new Mesh(new RoundedBoxGeometry(x, y, z, 4, EDGE_RADIUS), this.#tableMaterial);
    mesh.position.set(...center);
    mesh.castShadow = mesh.receiveShadow = true;
    return mesh;
  }

  // Pedestal of the robot at the origin; table and pedestal stand on the same floor.
  #pedestal({ center, half }: Table): Mesh {
    const height = half[2] - center[2];
    const shape = new CylinderGeometry(0.125, 0.14, height, 64).rotateX(Math.PI / 2);
    const mesh = new Mesh(shape, this.#pedestalMaterial);
    mesh.position.z = -height / 2;
    mesh.castShadow = mesh.receiveShadow = true;
    return mesh;
  }

  // Only the shadows on the floor are rendered, so that it blends into the background.
  #floor({ center, half }: Table): Mesh {
    const mesh = new Mesh(new CircleGeometry(4, 48), this.#shadow);
    // At the upper end of the table's rounded bottom edge, where light would leak below it.
    mesh.position.set(center[0], center[1], center[2] - half[2] + EDGE_RADIUS);
    mesh.receiveShadow = true;
    return mesh;
  }

  #workspaceOutline({ x, y }: Rectangle, top: number): LineLoop {
    const z = top + 0.001;
    const corners = [x[0], y[0], z, x[1], y[0], z, x[1], y[1], z, x[0], y[1], z];
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(corners), 3));
    return new LineLoop(geometry, this.#outline);
  }
}

function keyLight({ center }: Table, texels: number): DirectionalLight {
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
  view.left = view.bottom = -SHADOW_HALF_WIDTH;
  view.right = view.top = SHADOW_HALF_WIDTH;
  view.near = 0.5;
  view.far = 6;
  return light;
}
