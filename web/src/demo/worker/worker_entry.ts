// Entry of the Web Worker: loads the wasm module and starts it.

import init, { start } from "sim/sim.js";
import wasm from "sim/sim_bg.wasm?url";
import { ERRORS } from "../app/strings";
import type { FailureEvent } from "./messages";

try {
  await init({ module_or_path: wasm });
  start();
} catch (error) {
  const isUnsupported = typeof WebAssembly !== "object" || error instanceof WebAssembly.CompileError;
  const failure: FailureEvent = isUnsupported
    ? { kind: "failure", code: "wasm_unsupported", ...ERRORS.unsupported }
    : { kind: "failure", code: "worker_not_loaded", ...ERRORS.notLoaded(String(error)) };
  postMessage(failure);
}
