// Resources of the job server (docs/api.md).

import type { Orientation } from "../demo/worker/protocol";
import { KINDS } from "./kinds";

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

// Evaluation report of one policy on one object.
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
  // Present for mesh files.
  orientation?: Orientation;
  model_hash: string | null;
  // Present in the report of a job, absent in the summary of a model.
  rows?: AttemptResult[];
  // Job that made the evaluation; present in the summary of a model.
  job?: string;
}

export interface AttemptResult {
  seed: number;
  // x (m), y (m), yaw (rad).
  pose: [number, number, number];
  outcome: { result: string; reason?: string };
  final_state_hash: string;
}

// Metric columns by name, in the layout of uPlot.
export type Columns = Record<string, (number | null)[]>;

export const ENDED: Status[] = ["succeeded", "failed", "cancelled"];

export function title(job: Job): string {
  return job.name ?? KINDS[job.kind] ?? job.kind;
}
