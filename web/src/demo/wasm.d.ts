// The worker's Rust, as `wasm-bindgen` exports it into web/engine/. Declared by hand, so that types
// can be checked before anything is built.

declare module "engine/engine.js" {
  export default function init(options: { module_or_path: string }): Promise<unknown>;
  // Answers messages from now on, and says `ready`.
  export function start(): void;
}
