// Entry of the Web Worker: loads the simulation and forwards the page's requests to it. Mesh files are read first.

import init, { receive, start } from "sim/sim.js";
import wasm from "sim/sim_bg.wasm?url";
import { ERRORS, FILES } from "../app/strings";
import { isRecording } from "../files/dropped_files";
import type { FailureEvent, Upload, WorkerRequest } from "./messages";
import type { WorkerEvent } from "./protocol";

// The last request; the next one waits for it, also while a mesh file is read.
let last = load();

self.onmessage = ({ data }: MessageEvent<WorkerRequest>) => {
  last = last.then(() => execute(data)).catch(reportError);
};

async function execute(request: WorkerRequest): Promise<void> {
  if (request.kind !== "upload" || isRecording(request.fileName)) return receive(request);
  const mesh = await readMesh(request);
  if (mesh) receive(mesh);
}

// The mesh of the file; null after an error, which is reported.
async function readMesh(upload: Upload): Promise<Upload | null> {
  postProgress(FILES.reading(upload.fileName), false);
  try {
    const { read } = await import("./mesh_reader");
    return await read(upload);
  } catch (error) {
    postProgress("", true);
    // Not an exception: the file is invalid.
    if (!(error instanceof Error)) post({ kind: "failure", ...(error as Omit<FailureEvent, "kind">) });
    else if (error instanceof WebAssembly.RuntimeError) throw error;
    else post({ kind: "failure", code: "worker_not_loaded", ...ERRORS.notLoaded(String(error)) });
    return null;
  }
}

function postProgress(label: string, finished: boolean): void {
  post({ kind: "progress", label, done: 0, total: null, unit: "steps", finished });
}

function post(event: WorkerEvent): void {
  postMessage(event);
}

async function load(): Promise<void> {
  try {
    await init({ module_or_path: wasm });
    start();
  } catch (error) {
    const isUnsupported = typeof WebAssembly !== "object" || error instanceof WebAssembly.CompileError;
    const failure = isUnsupported ? ERRORS.unsupported : ERRORS.notLoaded(String(error));
    post({ kind: "failure", code: isUnsupported ? "wasm_unsupported" : "worker_not_loaded", ...failure });
  }
}
