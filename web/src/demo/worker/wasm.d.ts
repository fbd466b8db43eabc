// Interface of the wasm module that `wasm-bindgen` writes to web/sim/. Declared by hand, so that types can be
// checked before the module is built.

declare module "sim/sim.js" {
  export default function init(options: { module_or_path: string }): Promise<unknown>;
  // Starts handling messages and posts `ready`.
  export function start(): void;
}
