// Resources of the job server (docs/api.md), from the OpenAPI description.

import type { Schemas } from "../common/openapi";
import { KINDS } from "./kinds";

export type Status = Schemas["Status"];
export type Progress = Schemas["JobProgress"];
export type JobEvent = Schemas["Event"];
export type Artifact = Schemas["JobArtifact"];
export type Checkpoint = Schemas["Checkpoint"];

// The form and the details read parameters by name, of any kind of job. Only a dry run has no id.
export type Job = Omit<Schemas["Job"], "id" | "params"> & { id: string; params: Record<string, unknown> };

// Evaluation report of one policy on one object.
export type Evaluation = Schemas["EvaluationReport"] & {
  // Present in the report file of a job, absent in the summary of a model.
  rows?: AttemptResult[];
  // Job that made the evaluation; present in the summary of a model.
  job?: string;
};

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
