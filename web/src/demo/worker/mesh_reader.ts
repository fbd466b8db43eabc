// Reads mesh files with a wasm module of its own.

import init, { readMesh } from "sim/mesh_reader.js";
import wasm from "sim/mesh_reader_bg.wasm?url";
import type { Upload } from "./messages";

let loading: Promise<unknown> | null = null;

// Loads the module; again after an error.
export async function load(): Promise<void> {
  try {
    await (loading ??= init({ module_or_path: wasm }));
  } catch (error) {
    loading = null;
    throw error;
  }
}

// The upload with the mesh for the simulation instead of the file. Throws an object with code, message and hint if the
// file is invalid.
export function read(upload: Upload): Upload {
  return { ...upload, bytes: readMesh(upload.fileName, new Uint8Array(upload.bytes), upload).buffer };
}
