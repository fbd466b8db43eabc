// Entry of the Web Worker: loads the simulation and forwards the page's requests to it. Mesh files are read first.

import init, { receive, start } from "sim/sim.js";
import wasm from "sim/sim_bg.wasm?url";
import { ERRORS, FILES } from "../app/strings";
import { isRecording } from "../files/dropped_files";
import { MESH_READER_FAILED } from "./messages";
import type { FailureEvent, Upload, WorkerRequest } from "./messages";
import type { WorkerEvent } from "./protocol";

// Time from the start of an attempt to the download of the mesh reader: files can then be dropped without a network, and the
// first attempt does not wait for the download.
const PRELOAD_DELAY_MS = 10_000;

// The last request; the next one waits for it, also while a mesh file is read.
let last = load();
let isPreloading = false;

self.onmessage = ({ data }: MessageEvent<WorkerRequest>) => {
  last = last.then(() => execute(data)).catch(reportError);
};

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

async function execute(request: WorkerRequest): Promise<void> {
  // An error is reported when a file needs the module.
  if (request.kind === "grasp" && !isPreloading) {
    isPreloading = true;
    setTimeout(() => void loadReader().catch(() => {}), PRELOAD_DELAY_MS);
  }
  if (request.kind !== "upload" || isRecording(request.fileName)) return receive(request);
  const mesh = await readMesh(request);
  if (mesh) receive(mesh);
}

async function loadReader() {
  const reader = await import("./mesh_reader");
  await reader.load();
  return reader;
}

// The upload with its mesh instead of the file; null after an error, which is reported.
async function readMesh(upload: Upload): Promise<Upload | null> {
  postProgress(FILES.reading(upload.fileName), false);
  const reader = await loadReader().catch((error: unknown) => {
    post({ kind: "failure", code: MESH_READER_FAILED, ...FILES.noReader(upload.fileName, String(error)) });
  });
  try {
    if (reader) return reader.read(upload);
  } catch (error) {
    // An exception stops the worker; another error is about the file.
    if (error instanceof Error) throw error;
    post({ kind: "failure", ...(error as Omit<FailureEvent, "kind">) });
  }
  postProgress("", true);
  return null;
}

function postProgress(label: string, finished: boolean): void {
  post({ kind: "progress", label, done: 0, total: null, unit: "steps", finished });
}

function post(event: WorkerEvent): void {
  postMessage(event);
}
