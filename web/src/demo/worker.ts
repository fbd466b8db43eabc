// Loads the Rust that does everything, and gets out of its way.

import init, { start } from "engine/engine.js";
import wasm from "engine/engine_bg.wasm?url";
import type { Failure } from "./protocol";
import { FAILURES } from "./strings";

try {
  await init({ module_or_path: wasm });
  start();
} catch (error) {
  const isUnsupported = typeof WebAssembly !== "object" || error instanceof WebAssembly.CompileError;
  const failure: Failure = isUnsupported
    ? { kind: "failure", code: "wasm_unsupported", ...FAILURES.unsupported }
    : { kind: "failure", code: "engine_not_loaded", ...FAILURES.notLoaded(String(error)) };
  postMessage(failure);
}
