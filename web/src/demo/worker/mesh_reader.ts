// Reads mesh files with a wasm module of its own, which is loaded with the first one.

import init, { readMesh } from "sim/mesh_reader.js";
import wasm from "sim/mesh_reader_bg.wasm?url";
import type { Upload } from "./messages";

let loading: Promise<unknown> | null = null;

// The upload with the mesh for the simulation instead of the file.
export async function read(upload: Upload): Promise<Upload> {
  try {
    await (loading ??= init({ module_or_path: wasm }));
  } catch (error) {
    loading = null;
    throw error;
  }
  return { ...upload, bytes: readMesh(upload.fileName, new Uint8Array(upload.bytes), upload).buffer };
}
