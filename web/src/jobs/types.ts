// Jobs and what comes of them, as the server tells (docs/api.md).

import type { Stands } from "../demo/protocol";
import { KINDS } from "./strings";

export type Status = "queued" | "running" | "paused" | "cancelling" | "succeeded" | "failed" | "cancelled";

export interface Progress {
  completed: number;
  total: number;
  unit: string;
  fraction: number;
  rate_per_second: number | null;
  eta_seconds: number | null;
}

export interface Job {
  id: string;
  kind: string;
  status: Status;
  phase: string | null;
  progress: Progress | null;
  created_at: string;
  started_at: string | null;
  finished_at: string | null;
  params: Record<string, unknown>;
  seed: number;
  name: string | null;
  priority: number;
  inputs: Record<string, string>;
  outputs: { dataset_id?: string; model_id?: string; artifact_ids: string[] };
  latest_metrics: Record<string, unknown>;
  checkpoint_count: number;
  resumable: boolean;
  error: { code: string; message: string; param: string | null; hint: string | null } | null;
  worker: { host: string; pid: number; version: string } | null;
  attempt: number;
  estimate?: { seconds: number | null; bytes: number | null };
}

export interface JobEvent {
  id: string;
  seq: number;
  job: string;
  created_at: string;
  level: "info" | "warn" | "error";
  type: "status" | "progress" | "metric" | "log" | "checkpoint" | "artifact" | "alert";
  message: string;
  data: Record<string, unknown>;
}

export interface Artifact {
  hash: string;
  name: string;
  bytes: number;
  content_type: string;
}

export interface Checkpoint {
  step: number;
  model_id: string;
  bytes: number;
  metrics: Record<string, unknown>;
  demo_url: string;
}

// Of one policy and object.
export interface Evaluation {
  policy: string;
  object: string;
  attempts: number;
  lifted: number;
  wilson95: [number, number];
  failures: Record<string, number>;
  seed: number;
  scene_hash: string;
  object_hash: string;
  // Of a mesh file; reports from before it was written took a file as it is.
  stands?: Stands;
  model_hash: string | null;
  // In the report of a job, not where it is summed up.
  rows?: Attempted[];
  // The job that made it, where it is summed up.
  job?: string;
}

// One attempt.
export interface Attempted {
  seed: number;
  pose: [number, number, number];
  verdict: { outcome: string; reason?: string };
  state_hash: string;
}

// Columns of numbers, as uPlot takes them.
export type Columns = Record<string, (number | null)[]>;

export const ENDED: Status[] = ["succeeded", "failed", "cancelled"];

export function title(job: Job): string {
  return job.name ?? KINDS[job.kind] ?? job.kind;
}
