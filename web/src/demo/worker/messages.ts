// Types derived from the generated messages.

import type { SimRequest, UpAxis, Unit, WorkerEvent } from "./protocol";

// Event of one kind, with its tag.
export type EventOf<Kind extends WorkerEvent["kind"]> = Extract<WorkerEvent, { kind: Kind }>;

export type FailureEvent = EventOf<"failure">;

// The module that reads mesh files could not be downloaded; the file can be selected again.
export const MESH_READER_FAILED = "mesh_reader_failed";

type SimUpload = Extract<SimRequest, { kind: "upload" }>;

// The user's options for reading a mesh file; null selects the default.
export interface ReadOptions {
  unit: Unit | null;
  // Length of the longest side, instead of unit and scale.
  sizeM: number | null;
  // Factor on the coordinates, in addition to the unit.
  scale: number | null;
  // Axis of the file that points up.
  up: UpAxis | null;
}

// The user's options for a mesh file; null selects the default.
export type ImportOptions = ReadOptions & Pick<SimUpload, "massKg" | "orientation">;

// A file as the user selected it: a mesh, or a recording.
export type Upload = SimUpload & ReadOptions;

// Request to the worker: to its simulation, or a file that the worker reads first.
export type WorkerRequest = Exclude<SimRequest, SimUpload> | Upload;

// All options by default.
export const DEFAULT_OPTIONS: ImportOptions = { unit: null, sizeM: null, scale: null, up: null, massKg: null, orientation: null };
