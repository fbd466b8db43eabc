// Messages between the page and its worker, generated from wasm/src/protocol. Do not edit.
//
// Metres, radians, kilograms, seconds; z is up; quaternions are x, y, z, w. The worker generates the texts
// about objects and attempts; the page only displays them.

/**
 * Unit of length of a mesh file.
 */
export type Unit = "m" | "cm" | "mm" | "in";

/**
 * Axis of a mesh file that points up.
 */
export type UpAxis = "x" | "y" | "z";

/**
 * Reason of an orientation.
 */
export type OrientationReason = "given" | "yUpFile" | "settled" | "unstable" | "chosenByModel";

/**
 * Orientation of the file, or a stable pose by index; 0 is the most stable one.
 */
export type Orientation = "asInFile" | { stablePose: number };

/**
 * Phases of an attempt; `Idle` is before the first one and after a reset.
 */
export type Phase = "idle" | "approach" | "policy" | "lift" | "hold" | "outcome";

/**
 * Pose of the object on the table.
 */
export type PlanarPose = { x: number, y: number, yaw: number, };

/**
 * Spring force of the user on the object: attachment point (object frame) and target (world frame).
 */
export type Drag = { point: [number, number, number], target: [number, number, number], };

/**
 * Triangle mesh: three coordinates per vertex, three indices per triangle.
 */
export type Shape = { positions: Float32Array, indices: Uint32Array, };

/**
 * Rendered part of the robot, fixed to the body with this index.
 */
export type Link = { body: number, color: string, shape: Shape, };

export type Table = { center: [number, number, number], half: [number, number, number], };

export type Rectangle = { x: [number, number], y: [number, number], };

export type DepthCamera = { position: [number, number, number], target: [number, number, number], hfovDeg: number, aspect: number, };

export type BuiltIn = { name: string, label: string, shape: Shape, };

/**
 * Joint, index of the body that it moves, and its limits (rad).
 */
export type Joint = { name: string, body: number, lower: number, upper: number, };

/**
 * Properties of an object and findings of its import.
 */
export type ObjectInfo = { extentCm: [number, number, number], massKg: number, triangles: number, watertight: boolean, convexParts: number, unit: Unit | null, unitReason: string | null,
/**
 * Number of stable poses, and the orientation; `None` for built-in objects.
 */
stablePoses: number, orientation: Orientation | null,
/**
 * Reason of the orientation; `None` for built-in objects.
 */
orientationReason: OrientationReason | null,
/**
 * Whether the hand can grasp it, by width and height.
 */
graspability: string, notes: Array<string>, };

/**
 * Replayed file or grasp search, run instead of the policy.
 */
export type PlaybackInfo = { description: string,
/**
 * Headline of the phase in which the hand closes.
 */
closingLabel: string,
/**
 * Recorded hash of the final state, if there is one.
 */
finalStateHash: string | null, };

/**
 * Number of attempts and successes, with the 95 % Wilson interval of the success rate.
 */
export type Tally = { lifted: number, attempts: number, interval: [number, number], };

/**
 * Norms of the acceleration terms of a fabric (rad/s²).
 */
export type TermNorms = { geometry: number, energization: number, potential: number, damping: number, };

/**
 * Telemetry of one tick.
 */
export type TelemetrySample = {
/**
 * Half the squared norm of the joint velocities (rad²/s²).
 */
energy: number,
/**
 * Distance of the joint that is nearest to a limit (rad).
 */
limitMargin: number,
/**
 * Maximum damping (1/s); `None` without a fabric.
 */
damping: number | null,
/**
 * Norms of the fabric's acceleration terms; `None` without a fabric.
 */
terms: TermNorms | null, };

export type ProgressUnit = "bytes" | "steps";

export type Ready = { links: Array<Link>, table: Table, workspace: Rectangle, camera: DepthCamera, objects: Array<BuiltIn>, joints: Array<Joint>,
/**
 * Hash of scene file and robot. Equal hashes and seeds give equal final states.
 */
sceneHash: string,
/**
 * Max size of a mesh file (bytes).
 */
maxMeshBytes: number, };

export type ObjectLoaded = { name: string | null,
/**
 * Hash of shape, mass and friction.
 */
hash: string, label: string, shape: Shape, hulls: Array<Shape>, info: ObjectInfo,
/**
 * Attempts of the current policy with this object.
 */
tally: Tally, };

export type Frame = {
/**
 * Seven numbers per body: position, quaternion; the robot's bodies, then the object.
 */
poses: Float32Array, pose: PlanarPose,
/**
 * Seed from which the pose was sampled; `None` for a custom pose.
 */
poseSeed: number | null, playback: PlaybackInfo | null, phase: Phase,
/**
 * Displayed tick, last tick, and the first tick of each phase so far.
 */
tick: number, ticks: number, phaseStarts: Array<[Phase, number]>,
/**
 * Commanded joint positions (rad).
 */
joints: Float32Array,
/**
 * Poses of the robot's bodies at the commanded joint positions, seven numbers per body.
 */
commandedPoses: Float32Array,
/**
 * Contact forces on the object, six numbers per contact: point (m), force (N).
 */
contacts: Float32Array,
/**
 * Set while telemetry is streamed.
 */
telemetry: TelemetrySample | null, time: number, running: boolean, speed: number, realtimeFactor: number | null, };

export type Cloud = { points: Float32Array,
/**
 * Reconstruction of the cloud by the decoder; empty without an encoder.
 */
reconstruction: Float32Array,
/**
 * Reconstruction error and its interpretation; `None` without an encoder.
 */
familiarity: string | null, };

export type Progress = { label: string, done: number, total: number | null, unit: ProgressUnit, finished: boolean, };

export type Model = { id: string | null,
/**
 * Hash of the model files.
 */
hash: string | null, text: string, tally: Tally, };

export type Outcome = { lifted: boolean, text: string,
/**
 * Measurements that explain a failure: contacts, slip, height.
 */
evidence: string | null, seed: number, pose: PlanarPose,
/**
 * Whether the pose differs from the pose that the seed samples.
 */
placedByHand: boolean,
/**
 * Set for playback, which is not counted.
 */
playback: PlaybackInfo | null,
/**
 * Whether the user pulled the object. Disturbed attempts are not counted.
 */
disturbed: boolean, finalStateHash: string, tally: Tally, };

/**
 * Result of one attempt of a batch.
 */
export type BatchAttempt = { seed: number, pose: PlanarPose, lifted: boolean, text: string,
/**
 * Duration of the attempt (simulated s).
 */
time: number, finalStateHash: string, };

/**
 * An attempt of a batch with the counts.
 */
export type AttemptFinished = {
/**
 * Id of the batch.
 */
batchId: number, attempt: BatchAttempt,
/**
 * Attempts of the batch so far.
 */
batchTally: Tally,
/**
 * All attempts of the current policy with the object.
 */
tally: Tally, };

/**
 * Result of a grasp search.
 */
export type GraspsFound = {
/**
 * Robust grasps, for `PlayGrasps`.
 */
grasps: Array<Uint8Array>,
/**
 * Number of grasps that were tried.
 */
tried: number,
/**
 * Hash of the object that the grasps belong to.
 */
objectHash: string, };

/**
 * Tasks of a grasp search, and its results so far.
 */
export type SearchBatch = {
/**
 * The object for `LoadObjectBytes`, in the first batch.
 */
object: Uint8Array | null,
/**
 * Tasks, for `RunSearchTask`.
 */
tasks: Array<Uint8Array>,
/**
 * Estimated completed fraction, 0 to 1.
 */
fraction: number, found: GraspsFound, };

/**
 * File to download.
 */
export type SavedFile = { name: string, text: string, };

/**
 * Failure with a message and a hint.
 */
export type Failure = { code: string, message: string, hint: string, };

/**
 * Event of the worker.
 */
export type WorkerEvent = { "kind": "ready" } & Ready | { "kind": "object" } & ObjectLoaded | { "kind": "frame" } & Frame | { "kind": "telemetry", samples: Array<TelemetrySample>, } | { "kind": "cloud" } & Cloud | { "kind": "progress" } & Progress | { "kind": "model" } & Model | { "kind": "outcome" } & Outcome | { "kind": "batchStarted", batchId: number,
/**
 * The object for `LoadObjectBytes`.
 */
object: Uint8Array, } | { "kind": "attemptsTaken", worker: number, seed: number, attempts: number, } | { "kind": "attemptFinished" } & AttemptFinished | { "kind": "batchFinished", batchId: number, } | { "kind": "searchBatch" } & SearchBatch | { "kind": "searchTaskDone",
/**
 * Index of the task in its batch.
 */
index: number, result: Uint8Array, } | { "kind": "graspsFound" } & GraspsFound | { "kind": "file" } & SavedFile | { "kind": "failure" } & Failure;

/**
 * Request to the simulation. In JavaScript, `kind` is a field next to the others.
 */
export type SimRequest = { "kind": "loadObject", object: string, } | { "kind": "upload", fileName: string, bytes: ArrayBuffer, massKg: number | null, orientation: Orientation | null, } | { "kind": "loadModel", id: string, base: string, onlyIfIdle: boolean, } | { "kind": "place", pose: PlanarPose, } | { "kind": "placeBySeed", seed: number, } | { "kind": "grasp", seed: number, } | { "kind": "pause" } | { "kind": "resume" } | { "kind": "step" } | { "kind": "reset" } | { "kind": "speed", factor: number, } | { "kind": "seek", tick: number, } | { "kind": "streamTelemetry", on: boolean, } | { "kind": "batch", seed: number, attempts: number,
/**
 * Batch id, part of the resulting events.
 */
batchId: number,
/**
 * Number of workers that execute it, with this one.
 */
workers: number, } | { "kind": "takeAttempts", batchId: number,
/**
 * Number of the worker, part of the resulting event.
 */
worker: number, } | { "kind": "countAttempt", batchId: number, attempt: BatchAttempt, } | { "kind": "drag", drag: Drag | null, } | { "kind": "cancelBatch" } | { "kind": "exportRecording" } | { "kind": "searchGrasps", isLong: boolean, } | { "kind": "cancelSearch" } | { "kind": "loadObjectBytes", object: Uint8Array, } | { "kind": "runSearchTask", seed: number, isLong: boolean,
/**
 * Index of the task in its batch.
 */
index: number, task: Uint8Array, } | { "kind": "completeSearchBatch", results: Array<Uint8Array>, } | { "kind": "playGrasps", seed: number, grasps: Array<Uint8Array>,
/**
 * Hash of the object that the grasps belong to.
 */
objectHash: string, } | { "kind": "panic" };
