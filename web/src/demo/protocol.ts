// What the page and its worker say to each other. The same in Rust: wasm/src/protocol.rs.
//
// Metres, radians, kilograms, seconds; z is up; quaternions are x, y, z, w. Words for people are
// made by the worker, which knows what happened; the page only shows them.

export type Unit = "m" | "cm" | "mm" | "in";

// Why an object stands as it does: as it is told or drawn; it would tip a little, and stands on its foot; it would fall
// over, and lies on its steadiest side; or it lies as it looks most like what the policy learned from.
export type Because = "given" | "drawnYUp" | "settled" | "wouldFall" | "laid";

// How an object stands: as in its file, or on one of the sides that hold it, the steadiest being 0.
export type Stands = "asInFile" | { on: number };

// What somebody says of a mesh file; null is guessed.
export interface Told {
  unit: Unit | null;
  massKg: number | null;
  stands: Stands | null;
}

// An attempt goes through these in order; "idle" is before the first and after a reset.
export type Phase = "idle" | "approach" | "policy" | "lift" | "hold" | "verdict";

// Where an object stands on the table.
export interface PlanarPose {
  x: number;
  y: number;
  yaw: number;
}

// Where somebody pulls at the object (its frame), and where to.
export interface Pull {
  point: [number, number, number];
  towards: [number, number, number];
}

export type ToWorker =
  | { kind: "load"; object: string }
  // A mesh, or a demonstration or a recorded attempt (JSON).
  | ({ kind: "upload"; fileName: string; bytes: ArrayBuffer } & Told)
  // Act by the model of this id, gently: unless something is under way when it has come; base is where the page lies.
  | { kind: "model"; id: string; base: string; gently: boolean }
  | { kind: "place"; pose: PlanarPose }
  // The pose that an attempt with this seed draws.
  | { kind: "randomPose"; seed: number }
  | { kind: "grasp"; seed: number }
  | { kind: "pause" }
  | { kind: "resume" }
  | { kind: "step" }
  | { kind: "reset" }
  | { kind: "speed"; factor: number }
  // Show how it was after this tick; resuming plays on from there.
  | { kind: "seek"; tick: number }
  // Whether the moment is wanted with every frame; then those so far come, too.
  | { kind: "watch"; on: boolean }
  // So many attempts of seeds from this one on, as fast as they go; the run is said with all that comes of it.
  | { kind: "batch"; seed: number; attempts: number; run: number }
  // Pull at a point of the object (its frame) towards a point; null lets go.
  | { kind: "pull"; pull: Pull | null }
  | { kind: "cancel" }
  // Write the attempt as a file.
  | { kind: "export" }
  // Search grasps of what stands there. It takes its time, and nothing else is heard meanwhile: a worker of its own is
  // to be asked, and ended if nobody waits any more.
  | { kind: "search"; seed: number }
  // An attempt with grasps that a search found, of the object with this hash.
  | { kind: "follow"; seed: number; grasps: string; object: string }
  // Panic, as a mistake in the program would: what the page makes of that can be tried.
  | { kind: "panic" };

// A surface: three numbers per vertex, three indices per triangle.
export interface Shape {
  positions: Float32Array;
  indices: Uint32Array;
}

// A part of the robot: it moves with the body of this index.
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

// What was found out about an object.
export interface Report {
  extentCm: [number, number, number];
  massKg: number;
  triangles: number;
  watertight: boolean;
  // Convex parts that collide.
  parts: number;
  // Only for uploads: the unit that was taken and why, and what else is worth knowing.
  unit: Unit | null;
  reason: string | null;
  // Sides that hold it, and how it stands; only for uploads.
  sides: number;
  stands: Stands | null;
  because: Because | null;
  // Whether the hand gets round it, and hold of it.
  fits: string;
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
  // Hash of scene file and robot: what it is the same for, ends the same.
  scene: string;
  // The longest mesh file that is read.
  mostBytes: number;
}

// A joint, the body that it moves, and its limits.
export interface Joint {
  name: string;
  body: number;
  lower: number;
  upper: number;
}

export interface ObjectLoaded {
  kind: "object";
  // The name of a built-in object, or null for an upload.
  name: string | null;
  // Of shape, mass and friction.
  hash: string;
  label: string;
  shape: Shape;
  hulls: Shape[];
  report: Report;
  // Attempts so far with this object.
  tally: Tally;
}

// What is played in place of an attempt of whoever acts, in words.
export interface Played {
  what: string;
  // Said while the hand closes.
  closes: string;
  // The state that it is to end in, if that was recorded.
  end: string | null;
}

export interface Frame {
  kind: "frame";
  // Seven numbers a body: position, quaternion; the robot's bodies, then the object.
  poses: Float32Array;
  pose: PlanarPose;
  // The seed that the pose was drawn from; null if the object was placed by hand.
  drawn: number | null;
  played: Played | null;
  phase: Phase;
  // Which tick is shown, how many there are, and the phases so far, each with its first one.
  tick: number;
  ticks: number;
  marks: [Phase, number][];
  // Commanded positions of all joints.
  joints: Float32Array;
  // Where they would have the robot's bodies: seven numbers each.
  target: Float32Array;
  // What presses on the object, six numbers each: where (m), and with what force (N).
  contacts: Float32Array;
  // If it is watched.
  moment: Moment | null;
  // Since the attempt began.
  time: number;
  running: boolean;
  // Simulated seconds per second as asked for, and as measured while running.
  factor: number;
  measured: number | null;
}

export interface Cloud {
  kind: "cloud";
  points: Float32Array;
  // What the encoder makes of it; nothing where no encoder was asked.
  reconstruction: Float32Array;
  // How far that is from the cloud, and what that means.
  likeness: string | null;
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

// The learned policy: which one acts, or who does instead. Attempts can begin once this is known.
export interface Model {
  kind: "model";
  id: string | null;
  // Of its files.
  hash: string | null;
  words: string;
  // Attempts so far by it with the object that stands there.
  tally: Tally;
}

export interface Verdict {
  kind: "verdict";
  lifted: boolean;
  words: string;
  seed: number;
  pose: PlanarPose;
  // Whether the object was placed by hand, not where the seed puts it.
  placed: boolean;
  // What was played, if something was: it does not count.
  played: Played | null;
  // Whether somebody pulled at the object: then it does not count either.
  pulled: boolean;
  // Of the final state, the same on every machine.
  hash: string;
  tally: Tally;
}

// Attempts so far with this object, and the Wilson 95 % interval of their success.
export interface Tally {
  lifted: number;
  attempts: number;
  interval: [number, number];
}

// One moment of an attempt.
export interface Moment {
  // Half the square of the joint velocities (rad²/s²).
  energy: number;
  // Distance of the joint nearest to a limit from it (rad).
  margin: number;
  // Greatest damping (1/s), where a fabric acts.
  damping: number | null;
  // Norms of what its acceleration is the sum of (rad/s²), where a fabric acts.
  terms: { geometry: number; energization: number; potential: number; damping: number } | null;
}

// The moments of the attempt so far, tick by tick.
export interface Course {
  kind: "course";
  moments: Moment[];
}

// How one attempt of a batch ended.
export interface Attempted {
  kind: "attempted";
  // Of the batch.
  run: number;
  seed: number;
  pose: PlanarPose;
  lifted: boolean;
  words: string;
  time: number;
  hash: string;
  // Of the batch so far.
  row: Tally;
  // Of all attempts with the object.
  tally: Tally;
}

// What a search found.
export interface Found {
  kind: "found";
  words: string;
  // Hash of the object that they are of.
  object: string;
  // Reliable grasps, to be followed.
  grasps: string;
  count: number;
}

export interface BatchOver {
  kind: "batchOver";
  run: number;
}

// A file to be saved.
export interface SavedFile {
  kind: "file";
  name: string;
  text: string;
}

export interface Failure {
  kind: "failure";
  code: string;
  cause: string;
  cure: string;
}

export type FromWorker =
  | Ready
  | ObjectLoaded
  | Frame
  | Course
  | Cloud
  | Progress
  | Model
  | Verdict
  | Attempted
  | BatchOver
  | Found
  | SavedFile
  | Failure;
