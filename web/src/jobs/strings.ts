// What the jobs page says. Static text stands in jobs/index.html.

export const KINDS: Record<string, string> = {
  "dataset.generate": "Make a dataset",
  "encoder.train": "Train an encoder",
  "policy.train": "Train a policy",
  "policy.evaluate": "Evaluate a policy",
  "mesh.prepare": "Look at a mesh",
};

export const STATUSES: Record<string, string> = {
  queued: "waiting",
  running: "running",
  paused: "paused",
  cancelling: "stopping",
  succeeded: "done",
  failed: "failed",
  cancelled: "stopped",
};

// What a job is at, by the names of its program.
export const PHASES: Record<string, string> = {
  grasps: "Searching grasps",
  "hundreds of clouds": "Taking clouds, a hundred at a time",
  "object poses": "Demonstrating, pose by pose",
  "files of rows": "Writing files",
  training: "Training",
  policy: "Attempts by the policy",
  planner: "Attempts by the planner",
  "no policy": "Attempts by a script, without a policy",
  "shuffled z": "Attempts that are told of another pose",
  "zero z": "Attempts that are told nothing of the object",
  "policy, friction 0": "Attempts by the policy without friction",
  "planner, friction 0": "Attempts by the planner without friction",
};

// Why an attempt failed.
export const FAILURES: Record<string, string> = {
  unseen: "not seen",
  unreachable: "out of reach",
  shifted: "moved untouched",
  collided: "collided on the way",
  missed: "missed",
  pushed_away: "pushed away",
  slipped: "slipped",
  low: "too low",
  dropped: "dropped",
  not_finite: "left the finite numbers",
};

// The bar at the top, and the list.
export const CONNECTION = { connecting: "connecting", live: "live", lost: "connection lost, trying again" } as const;

export const LIST = {
  choose: "Choose a job, or begin a new one.",
  none: "No jobs here yet.",
  more: "Fetching more…",
  tryAgain: "Try again",
  compare: (title: string) => `Compare ${title}`,
} as const;

// How far a job is.
export const PROGRESS = {
  title: "Progress",
  rate: (rate: string) => `${rate} a second`,
  left: (duration: string) => `${duration} left`,
  leftOfPart: (duration: string) => `${duration} left of this part`,
} as const;

// Names of facts, whatever they are of.
export const FACTS = {
  id: "Id",
  dataset: "Dataset",
  model: "Model",
  demo: "Demo",
  step: "Step",
  seed: "Seed",
  size: "Size",
  made: "Made",
  madeBy: "Made by",
} as const;

// What leads to the demo.
export const DEMO = { tryIn: "Try in demo", tryIt: "Try it in the demo", play: "Play" } as const;

// One job.
export const JOB = {
  pause: "Pause",
  resume: "Resume",
  goOn: "Go on",
  tryAgain: "Try again",
  stop: "Stop",
  again: "Again with changes",
  rename: "Rename",
  nameOf: "Name of the job",
  delete: "Delete",
  deleted: "This job will be deleted; what it made stays. ",
  undo: "Undo",
  kept: "This job is not deleted.",
  waits: "It waits for its turn.",
  waitsAgain: "It waits to go on.",
  stopping: "It is stopping.",
  begun: (attempts: number) => `, begun ${attempts} times`,
  made: "What came of it",
  madeNothing: "Nothing yet.",
  told: "What it was told",
  worker: "worker",
  workerOf: (host: string, version: string) => `${host}, ngf ${version}`,
} as const;

export const EVALUATION = {
  title: "Evaluation",
  head: ["Object", "By", "", "Lifted", "95 % interval", "Failures", "First seed"],
  none: "It has not been evaluated yet.",
  evaluateIt: "Evaluate it",
  attempt: (seed: number, reason: string) => `seed ${seed}: ${reason}`,
} as const;

export const CHECKPOINTS = {
  title: "Checkpoints",
  head: ["Step", "Loss", "Size", "Model", "", ""],
  evaluate: "Evaluate",
} as const;

export const LOG = {
  title: "Log",
  lines: "Lines",
  all: "all lines",
  warnings: "warnings and errors",
  search: "Search",
  searchIt: "Search the log",
  follow: "follow",
  download: "Download",
  none: "Nothing yet.",
  end: "What its process said last",
} as const;

export const ALERTS = { title: "What somebody should look at" } as const;

export const CHARTS = {
  title: "Measured",
  value: "value",
  raw: (label: string) => `${label}, raw`,
  step: "step",
  time: "time",
  axis: "Horizontal axis",
  byStep: "by step",
  byTime: "by time",
  smoothing: "Smoothing",
  logX: "log x",
  logY: "log y",
  hint: "Drag to zoom in, with Shift to move; a double click shows all.",
} as const;

export const COMPARISON = {
  title: "Comparison",
  jobs: "Jobs",
  differences: "In what they differ",
  none: "They were told the same.",
} as const;

// A new job. What its parameters mean is told by the server.
export const FORM = {
  title: "New job",
  whatToDo: "What to do",
  name: "Name",
  forPeople: "for people",
  changed: (title: string) => `${title}, changed`,
  begin: "Begin",
  about: (duration: string) => `about ${duration}`,
  disk: (size: string) => `${size} of disk`,
  takes: (parts: string[]) => `It takes ${parts.join(" and ")}.`,
  tokenFirst: "The server asks for its token when you begin; without the token it makes no estimate.",
  planner: "planner: knows the object, plans a grasp of its own",
  step: (step: string) => `step ${step}`,
} as const;

export const PARAMETERS: Record<string, string> = {
  dataset_id: "Dataset",
  encoder_id: "Encoder",
  model_id: "Model",
  mesh_id: "Mesh",
  mass_kg: "Mass (kg)",
  density_kg_m3: "Density (kg/m³)",
};

// A list that comes in pages.
export const PAGES = { more: "More" } as const;

// What jobs made and people brought.
export const DATASETS = {
  title: "Datasets",
  head: ["Dataset", "Of", "Demonstrations", "Size", "Made"],
  none: "None yet. A job makes one.",
  objects: (count: number) => `${count} objects`,
} as const;

export const DATASET = {
  title: "Dataset",
  objects: "Objects",
  objectsHead: ["Object", "Kept", "Poses with enough", "The others"],
  episodes: "Demonstrations",
  episodesHead: ["Number", "Object", "Pose", "x, y, turn", "", "File"],
  noEpisodes: "None was kept.",
} as const;

export const MODELS = {
  title: "Models",
  head: ["Model", "Kind", "Step", "Made", ""],
  none: "None yet. A job makes one.",
  builtIn: "came with the program",
} as const;

export const MODEL = { title: "Model", files: "Files", filesHead: ["File", "BLAKE3"] } as const;

export const MESHES = {
  title: "Meshes",
  hint: "Meshes that the server keeps, for datasets and evaluations. What is dropped on the demo stays on your device.",
  file: "Mesh file",
  none: "None yet.",
  head: ["Mesh", "Size", "Triangles", "File", "", "", ""],
  triangles: (count: string, watertight: boolean) => `${count}, ${watertight ? "closed" : "open"}`,
  parts: "Convex parts",
  delete: "Delete",
} as const;
