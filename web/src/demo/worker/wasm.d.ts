// Interfaces of the wasm modules that `wasm-bindgen` writes to web/sim/. Declared by hand, so that types can be
// checked before the modules are built.

declare module "sim/sim.js" {
  export default function init(options: { module_or_path: string }): Promise<unknown>;
  // Sets up the session and posts `ready`.
  export function start(): void;
  // Executes a request.
  export function receive(request: unknown): void;
}

declare module "sim/mesh_reader.js" {
  export default function init(options: { module_or_path: string }): Promise<unknown>;
  // Reads a mesh file with `ReadOptions`. The result is the mesh for the simulation. Throws an object with code,
  // message and hint if the file is invalid.
  export function readMesh(fileName: string, bytes: Uint8Array, options: unknown): Uint8Array<ArrayBuffer>;
}
