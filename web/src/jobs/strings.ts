// Texts of the Jobs page. Static text is in jobs/index.html.

export const STATUSES: Record<string, string> = {
  queued: "Queued",
  running: "Running",
  paused: "Paused",
  cancelling: "Cancelling",
  succeeded: "Succeeded",
  failed: "Failed",
  cancelled: "Cancelled",
};

// Phases by the name that the worker reports.
export const PHASES: Record<string, string> = {
  grasps: "Searching for grasps",
  "point cloud files": "Rendering point clouds (×100)",
  "object poses": "Planning demonstrations (object poses)",
  "Parquet files": "Writing Parquet files",
  training: "Training",
  policy: "Evaluating policy",
  planner: "Evaluating planner",
  "no policy": "Control: no policy (scripted closing)",
  "shuffled z": "Control: shuffled z (of another pose)",
  "zero z": "Control: zero z",
  "policy, friction 0": "Control: policy, zero friction",
  "planner, friction 0": "Control: planner, zero friction",
};

// Failure reasons of attempts.
export const FAILURES: Record<string, string> = {
  not_visible: "not visible",
  unreachable: "out of reach",
  disturbed: "moved before contact",
  collided: "collided during approach",
  missed: "not raised",
  pushed_away: "pushed away",
  slipped: "slipped",
  too_low: "too low",
  dropped: "dropped",
  not_finite: "simulation diverged",
};

export const CONNECTION = { connecting: "Connecting…", live: "Live", lost: "Connection lost. Reconnecting…" } as const;

export const LIST = {
  noWorker: "The program that runs the jobs is being built. Queued jobs start when it is ready.",
  choose: "Select a job or start a new one.",
  none: "No jobs.",
  loading: "Loading more…",
  retry: "Retry",
  compare: (title: string) => `Compare ${title}`,
} as const;

export const PROGRESS = {
  title: "Progress",
  rate: (rate: string) => `${rate}/s`,
  left: (duration: string) => `${duration} left`,
  leftOfPhase: (duration: string) => `${duration} left in this phase`,
} as const;

// Names of facts about jobs, datasets and models.
export const FACTS = {
  id: "ID",
  dataset: "Dataset",
  model: "Model",
  demo: "Demo",
  next: "Next",
  step: "Step",
  seed: "Seed",
  size: "Size",
  created: "Created",
  createdBy: "Created by",
  imported: "Imported",
  files: "Files",
} as const;

// Links to the demo.
export const DEMO = { tryIn: "Try in demo", tryIt: "Try this policy", play: "Play" } as const;

export const JOB = {
  pause: "Pause",
  resume: "Resume",
  retry: "Retry",
  cancel: "Cancel",
  duplicate: "Duplicate",
  rename: "Rename",
  newName: "Job name",
  delete: "Delete",
  willBeDeleted: "This job will be deleted. Its dataset and models are kept. ",
  undo: "Undo",
  deletionCancelled: "Deletion cancelled.",
  queued: "Queued.",
  queuedToResume: "Queued to resume.",
  cancelling: "Cancelling…",
  starts: (count: number) => `, started ${count} times`,
  outputs: "Outputs",
  noOutputs: "No outputs yet.",
  parameters: "Parameters",
  worker: "worker",
  workerVersion: (host: string, version: string) => `${host}, ngf ${version}`,
} as const;

export const EVALUATION = {
  title: "Evaluation",
  head: ["Object", "Policy", "", "Lifted", "95 % interval", "Failures", "First seed"],
  none: "Not evaluated yet.",
  evaluate: "Evaluate",
  attempt: (seed: number, reason: string) => `Seed ${seed}: ${reason}`,
} as const;

export const CHECKPOINTS = {
  title: "Checkpoints",
  head: ["Step", "Loss", "Size", "Model", "", ""],
  evaluate: "Evaluate",
} as const;

export const LOG = {
  title: "Log",
  lines: "Lines",
  all: "All lines",
  warnings: "Warnings and errors",
  search: "Search",
  searchLog: "Search log",
  follow: "Follow",
  download: "Download",
  none: "No output yet.",
  lastLines: "Last log lines",
} as const;

export const ALERTS = { title: "Alerts" } as const;

export const CHARTS = {
  title: "Metrics",
  value: "Value",
  raw: (label: string) => `${label} (raw)`,
  step: "Step",
  time: "Time",
  axis: "X axis",
  byStep: "By step",
  byTime: "By time",
  smoothing: "Smoothing",
  logX: "Log x",
  logY: "Log y",
  hint: "Drag to zoom, Shift-drag to pan, double-click to reset.",
} as const;

export const COMPARISON = {
  title: "Comparison",
  jobs: "Jobs",
  differences: "Parameter differences",
  identical: "All parameters are identical.",
} as const;

// Form of a new job. The server describes the parameters.
export const FORM = {
  title: "New job",
  noChoice: "none",
  missing: (names: string[]) => `Required: ${names.join(", ")}.`,
  kind: "Job kind",
  name: "Name",
  optional: "optional",
  copyOf: (title: string) => `${title} (copy)`,
  start: "Start",
  estimate: (parts: string[]) => `Estimate: ${parts.join(", ")}.`,
  required: "* required",
  tokenRequired: "The server requires a token to start a job or to estimate its cost.",
  planner: "planner (no policy; known object and pose)",
  step: (step: string) => `step ${step}`,
} as const;

// Run of all four jobs.
export const PIPELINE = {
  start: "Run the whole pipeline",
  description: "At toy size, in about a minute: generates a dataset, trains an encoder and a policy, evaluates the policy. The policy does not work; it shows the steps.",
  job: (step: number, total: number) => `Toy pipeline, ${step} of ${total}`,
} as const;

export const PARAMETERS: Record<string, string> = {
  dataset_id: "Dataset",
  encoder_id: "Encoder",
  model_id: "Model",
  mesh_id: "Mesh",
  mass_kg: "Mass (kg)",
  density_kg_m3: "Density (kg/m³)",
};

export const TABLE = { more: "Show more" } as const;

export const DATASETS = {
  title: "Datasets",
  head: ["Dataset", "Objects", "Demonstrations", "Size", "Created"],
  none: "No datasets yet. Start a “Generate dataset” job to create one.",
  objects: (count: number) => `${count} objects`,
} as const;

export const DATASET = {
  title: "Dataset",
  objects: "Objects",
  objectsHead: ["Object", "Kept", "Poses with full coverage", "Rejected (by reason)"],
  episodes: "Demonstrations",
  episodesHead: ["Episode", "Object", "Pose", "x, y, yaw", "", "File"],
  noEpisodes: "No demonstrations.",
} as const;

export const MODELS = {
  title: "Models",
  head: ["Model", "Kind", "Step", "Created", ""],
  none: "No models yet. Start a “Train policy” job to create one.",
  builtIn: "built in",
} as const;

export const MODEL = { title: "Model", files: "Files", filesHead: ["File", "BLAKE3"] } as const;

export const MESHES = {
  title: "Meshes",
  hint: "Meshes on the server, for datasets and evaluations. Files dropped on the demo page stay on your device.",
  file: "Mesh file",
  none: "No meshes yet.",
  head: ["Mesh", "Dimensions", "Triangles", "File size", "", "", ""],
  triangles: (count: string, watertight: boolean) => `${count}, ${watertight ? "watertight" : "open"}`,
  inspect: "Inspect",
  delete: "Delete",
} as const;
