// Messages between the page and its worker. The same in Rust: wasm/src/protocol.
//
// Metres, radians, kilograms, seconds; z is up; quaternions are x, y, z, w. The worker generates the texts
// about objects and attempts; the page only displays them.

export type Unit = "m" | "cm" | "mm" | "in";

// Source of an orientation: the user's choice or a stable file; the y-up convention of the file; settling
// after a small tilt; the most stable pose in place of an unstable file; or the stable pose most similar to
// the training data.
export type OrientationReason = "given" | "yUpFile" | "settled" | "unstable" | "chosenByModel";

// Orientation of the file, or a stable pose by index; 0 is the most stable one.
export type Orientation = "asInFile" | { stablePose: number };

// The user's options for a mesh file; null selects the default.
export interface ImportOptions {
  unit: Unit | null;
  massKg: number | null;
  orientation: Orientation | null;
}

// Phases of an attempt in order; "idle" is before the first one and after a reset.
export type Phase = "idle" | "approach" | "policy" | "lift" | "hold" | "outcome";

// Pose of the object on the table.
export interface PlanarPose {
  x: number;
  y: number;
  yaw: number;
}

// Spring force of the user on the object: attachment point in the object frame, target in the world frame.
export interface Drag {
  point: [number, number, number];
  target: [number, number, number];
}

export type WorkerRequest =
  | { kind: "loadObject"; object: string }
  // A mesh, or a demonstration or a recorded attempt (JSON).
  | ({ kind: "upload"; fileName: string; bytes: ArrayBuffer } & ImportOptions)
  // Load this model. `onlyIfIdle` drops it if an attempt is running when the download completes. `base`: page
  // URL.
  | { kind: "loadModel"; id: string; base: string; onlyIfIdle: boolean }
  | { kind: "place"; pose: PlanarPose }
  // Place the object at the pose that an attempt with this seed samples.
  | { kind: "placeBySeed"; seed: number }
  | { kind: "grasp"; seed: number }
  | { kind: "pause" }
  | { kind: "resume" }
  | { kind: "step" }
  | { kind: "reset" }
  | { kind: "speed"; factor: number }
  // Show the state after this tick; `resume` plays from there.
  | { kind: "seek"; tick: number }
  // Add telemetry to each frame. Turning it on also posts the samples of the attempt so far.
  | { kind: "streamTelemetry"; on: boolean }
  // Run `attempts` attempts of consecutive seeds at full speed. `batchId` is part of the resulting events.
  | { kind: "batch"; seed: number; attempts: number; batchId: number }
  // Pull the object; null releases it.
  | { kind: "drag"; drag: Drag | null }
  | { kind: "cancelBatch" }
  | { kind: "exportRecording" }
  // Search for grasps of the current object. This blocks the worker, so each search uses a separate worker,
  // which is terminated to cancel the search.
  | { kind: "searchGrasps"; seed: number }
  // Start an attempt with the grasps of a search, for the object with this hash.
  | { kind: "playGrasps"; seed: number; grasps: string; objectHash: string }
  // Panic, to test the page's error handling.
  | { kind: "panic" };

// Triangle mesh: three coordinates per vertex, three indices per triangle.
export interface Shape {
  positions: Float32Array;
  indices: Uint32Array;
}

// Rendered part of the robot, fixed to the body with this index.
export interface Link {
  body: number;
  color: string;
  shape: Shape;
}

export interface Box {
  center: [number, number, number];
  half: [number, number, number];
}

export interface Rectangle {
  x: [number, number];
  y: [number, number];
}

export interface DepthCamera {
  position: [number, number, number];
  target: [number, number, number];
  hfovDeg: number;
  aspect: number;
}

// Properties of an object and findings of its import.
export interface ObjectInfo {
  extentCm: [number, number, number];
  massKg: number;
  triangles: number;
  watertight: boolean;
  // Number of convex parts of the collision shape.
  convexParts: number;
  // The next five are set only for uploads.
  unit: Unit | null;
  unitReason: string | null;
  // Number of stable poses.
  stablePoses: number;
  orientation: Orientation | null;
  orientationReason: OrientationReason | null;
  // Whether the hand can grasp it, by width and height.
  graspability: string;
  notes: string[];
}

export interface Ready {
  kind: "ready";
  links: Link[];
  table: Box;
  workspace: Rectangle;
  camera: DepthCamera;
  objects: { name: string; label: string; shape: Shape }[];
  joints: Joint[];
  // Hash of scene file and robot. Equal hashes and seeds give equal final states.
  sceneHash: string;
  // Maximum size of a mesh file (bytes).
  maxMeshBytes: number;
}

// Joint, the body that it moves, and its limits.
export interface Joint {
  name: string;
  body: number;
  lower: number;
  upper: number;
}

export interface ObjectLoaded {
  kind: "object";
  // Catalogue name of a built-in object, or null for an upload.
  name: string | null;
  // Hash of shape, mass and friction.
  hash: string;
  label: string;
  shape: Shape;
  hulls: Shape[];
  info: ObjectInfo;
  // Attempts of the current policy with this object.
  tally: Tally;
}

// Replayed file or grasp search, run instead of the policy.
export interface PlaybackInfo {
  description: string;
  // Headline of the phase in which the hand closes.
  closingLabel: string;
  // Recorded hash of the final state, if there is one.
  finalStateHash: string | null;
}

export interface Frame {
  kind: "frame";
  // Seven numbers per body: position, quaternion; the robot's bodies, then the object.
  poses: Float32Array;
  pose: PlanarPose;
  // Seed from which the pose was sampled; null for a custom pose.
  poseSeed: number | null;
  playback: PlaybackInfo | null;
  phase: Phase;
  // Displayed tick, last tick, and the first tick of each phase so far.
  tick: number;
  ticks: number;
  phaseStarts: [Phase, number][];
  // Commanded joint positions.
  joints: Float32Array;
  // Poses of the robot's bodies at the commanded joint positions, seven numbers per body.
  commandedPoses: Float32Array;
  // Contact forces on the object, six numbers per contact: point (m), force (N).
  contacts: Float32Array;
  // Set while telemetry is streamed.
  telemetry: TelemetrySample | null;
  // Since the start of the attempt.
  time: number;
  running: boolean;
  // Requested real-time factor, and the measured one while running.
  speed: number;
  realtimeFactor: number | null;
}

export interface Cloud {
  kind: "cloud";
  points: Float32Array;
  // Reconstruction of the cloud by the decoder; empty without an encoder.
  reconstruction: Float32Array;
  // Reconstruction error and its interpretation.
  familiarity: string | null;
}

export interface Progress {
  kind: "progress";
  label: string;
  done: number;
  // Null while unknown.
  total: number | null;
  unit: "bytes" | "steps";
  finished: boolean;
}

// The loaded policy, or null for the planner. Attempts can start after this event.
export interface Model {
  kind: "model";
  id: string | null;
  // Hash of the model files.
  hash: string | null;
  text: string;
  // Attempts of this policy with the current object.
  tally: Tally;
}

export interface Outcome {
  kind: "outcome";
  lifted: boolean;
  text: string;
  seed: number;
  pose: PlanarPose;
  // Whether the pose differs from the pose that the seed samples.
  placedByHand: boolean;
  // Set for playback, which is not counted.
  playback: PlaybackInfo | null;
  // Whether the user pulled the object. Disturbed attempts are not counted.
  disturbed: boolean;
  // The same on every machine.
  finalStateHash: string;
  tally: Tally;
}

// Attempts with an object, and the 95 % Wilson interval of the success rate.
export interface Tally {
  lifted: number;
  attempts: number;
  interval: [number, number];
}

// Telemetry of one tick.
export interface TelemetrySample {
  // Half the squared norm of the joint velocities (rad²/s²).
  energy: number;
  // Distance of the joint that is nearest to a limit (rad).
  limit_margin: number;
  // Maximum damping (1/s); null without a fabric.
  damping: number | null;
  // Norms of the fabric's acceleration terms (rad/s²); null without a fabric.
  terms: { geometry: number; energization: number; potential: number; damping: number } | null;
}

// Samples of the attempt so far, one per tick.
export interface Telemetry {
  kind: "telemetry";
  samples: TelemetrySample[];
}

// Result of one attempt of a batch.
export interface AttemptFinished {
  kind: "attemptFinished";
  batchId: number;
  seed: number;
  pose: PlanarPose;
  lifted: boolean;
  text: string;
  time: number;
  finalStateHash: string;
  // Attempts of the batch so far.
  batchTally: Tally;
  // All attempts of the current policy with the object.
  tally: Tally;
}

// Result of a grasp search.
export interface GraspsFound {
  kind: "graspsFound";
  text: string;
  // Hash of the object that the grasps belong to.
  objectHash: string;
  // The stable grasps, for `playGrasps`.
  grasps: string;
  count: number;
}

export interface BatchFinished {
  kind: "batchFinished";
  batchId: number;
}

// File to download.
export interface SavedFile {
  kind: "file";
  name: string;
  text: string;
}

export interface Failure {
  kind: "failure";
  code: string;
  message: string;
  hint: string;
}

export type WorkerEvent =
  | Ready
  | ObjectLoaded
  | Frame
  | Telemetry
  | Cloud
  | Progress
  | Model
  | Outcome
  | AttemptFinished
  | BatchFinished
  | GraspsFound
  | SavedFile
  | Failure;
