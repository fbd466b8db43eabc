// Types derived from the generated messages.

import type { WorkerEvent, WorkerRequest } from "./protocol";

// Event of one kind, with its tag.
export type EventOf<Kind extends WorkerEvent["kind"]> = Extract<WorkerEvent, { kind: Kind }>;

export type FailureEvent = EventOf<"failure">;

// The user's options for a mesh file; null selects the default.
export type ImportOptions = Pick<
  Extract<WorkerRequest, { kind: "upload" }>,
  "unit" | "sizeM" | "scale" | "up" | "massKg" | "orientation"
>;

// All options by default.
export const DEFAULT_OPTIONS: ImportOptions = { unit: null, sizeM: null, scale: null, up: null, massKg: null, orientation: null };
