//! Events of the worker.

use super::{PlanarPose, TelemetrySample};
use crate::statistics::Tally;
use js_sys::{Float32Array, Uint32Array};
use mesh::{Mesh, Unit};
use objects::import::{Orientation, OrientationReason};
use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;
use serde_wasm_bindgen::preserve;

/// Event of the worker.
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "WorkerEvent"))]
#[serde(tag = "kind", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(crate) enum Event {
    Ready(Ready),
    Object(ObjectLoaded),
    Frame(Frame),
    /// Telemetry of the attempt so far, one sample per tick.
    Telemetry {
        samples: Vec<TelemetrySample>,
    },
    Cloud(Cloud),
    Progress(Progress),
    Model(Model),
    Outcome(Outcome),
    /// A batch for several workers has started.
    BatchStarted {
        batch_id: u32,
        /// The object for `LoadObjectBytes`.
        #[cfg_attr(test, ts(type = "Uint8Array"))]
        object: ByteBuf,
    },
    /// Seeds of a batch for another worker; no attempts if all are taken.
    AttemptsTaken {
        worker: u32,
        seed: u32,
        attempts: u32,
    },
    /// An attempt of a batch has ended.
    AttemptFinished(AttemptFinished),
    /// A batch has finished or was cancelled.
    BatchFinished {
        batch_id: u32,
    },
    /// Next tasks of a grasp search.
    SearchBatch(SearchBatch),
    /// A task of a grasp search has been executed.
    SearchTaskDone {
        /// Index of the task in its batch.
        index: usize,
        #[cfg_attr(test, ts(type = "Uint8Array"))]
        result: ByteBuf,
    },
    /// A grasp search has ended.
    GraspsFound(GraspsFound),
    File(SavedFile),
    Failure(Failure),
}

/// Triangle mesh: three coordinates per vertex, three indices per triangle.
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Shape {
    #[serde(with = "preserve")]
    #[cfg_attr(test, ts(type = "Float32Array"))]
    positions: Float32Array,
    #[serde(with = "preserve")]
    #[cfg_attr(test, ts(type = "Uint32Array"))]
    indices: Uint32Array,
}

impl Shape {
    pub(crate) fn from_mesh(mesh: &Mesh) -> Self {
        let positions: Vec<f32> = mesh.vertices.iter().flat_map(|v| v.to_array()).collect();
        let indices = Uint32Array::from(mesh.triangles.as_flattened());
        Self { positions: Float32Array::from(positions.as_slice()), indices }
    }
}

/// Rendered part of the robot, fixed to the body with this index.
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Link {
    pub(crate) body: usize,
    pub(crate) color: &'static str,
    pub(crate) shape: Shape,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Table {
    pub(crate) center: [f32; 3],
    pub(crate) half: [f32; 3],
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Rectangle {
    pub(crate) x: [f32; 2],
    pub(crate) y: [f32; 2],
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct DepthCamera {
    pub(crate) position: [f32; 3],
    pub(crate) target: [f32; 3],
    pub(crate) hfov_deg: f32,
    pub(crate) aspect: f32,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct BuiltIn {
    pub(crate) name: &'static str,
    pub(crate) label: String,
    pub(crate) shape: Shape,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct Ready {
    pub(crate) links: Vec<Link>,
    pub(crate) table: Table,
    pub(crate) workspace: Rectangle,
    pub(crate) camera: DepthCamera,
    pub(crate) objects: Vec<BuiltIn>,
    pub(crate) joints: Vec<Joint>,
    /// Hash of scene file and robot. Equal hashes and seeds give equal final states.
    pub(crate) scene_hash: String,
    /// Max size of a mesh file (bytes).
    pub(crate) max_mesh_bytes: usize,
}

/// Joint, index of the body that it moves, and its limits (rad).
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) body: usize,
    pub(crate) lower: f32,
    pub(crate) upper: f32,
}

/// Properties of an object and findings of its import.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct ObjectInfo {
    pub(crate) extent_cm: [f32; 3],
    pub(crate) mass_kg: f32,
    pub(crate) triangles: usize,
    pub(crate) watertight: bool,
    pub(crate) convex_parts: usize,
    #[cfg_attr(test, ts(type = "Unit | null"))]
    pub(crate) unit: Option<Unit>,
    pub(crate) unit_reason: Option<String>,
    /// Number of stable poses, and the orientation; `None` for built-in objects.
    pub(crate) stable_poses: usize,
    #[cfg_attr(test, ts(type = "Orientation | null"))]
    pub(crate) orientation: Option<Orientation>,
    /// Reason of the orientation; `None` for built-in objects.
    #[cfg_attr(test, ts(type = "OrientationReason | null"))]
    pub(crate) orientation_reason: Option<OrientationReason>,
    /// Whether the hand can grasp it, by width and height.
    pub(crate) graspability: String,
    pub(crate) notes: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct ObjectLoaded {
    pub(crate) name: Option<String>,
    /// Hash of shape, mass and friction.
    pub(crate) hash: String,
    pub(crate) label: String,
    pub(crate) shape: Shape,
    pub(crate) hulls: Vec<Shape>,
    pub(crate) info: ObjectInfo,
    /// Attempts of the current policy with this object.
    pub(crate) tally: Tally,
}

/// Replayed file or grasp search, run instead of the policy.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct PlaybackInfo {
    pub(crate) description: String,
    /// Headline of the phase in which the hand closes.
    pub(crate) closing_label: &'static str,
    /// Recorded hash of the final state, if there is one.
    pub(crate) final_state_hash: Option<String>,
}

/// Phases of an attempt; `Idle` is before the first one and after a reset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) enum Phase {
    Idle,
    Approach,
    Policy,
    Lift,
    Hold,
    Outcome,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct Frame {
    /// Seven numbers per body: position, quaternion; the robot's bodies, then the object.
    #[serde(with = "preserve")]
    #[cfg_attr(test, ts(type = "Float32Array"))]
    pub(crate) poses: Float32Array,
    pub(crate) pose: PlanarPose,
    /// Seed from which the pose was sampled; `None` for a custom pose.
    pub(crate) pose_seed: Option<u32>,
    pub(crate) playback: Option<PlaybackInfo>,
    pub(crate) phase: Phase,
    /// Displayed tick, last tick, and the first tick of each phase so far.
    pub(crate) tick: usize,
    pub(crate) ticks: usize,
    pub(crate) phase_starts: Vec<(Phase, usize)>,
    /// Commanded joint positions (rad).
    #[serde(with = "preserve")]
    #[cfg_attr(test, ts(type = "Float32Array"))]
    pub(crate) joints: Float32Array,
    /// Poses of the robot's bodies at the commanded joint positions, seven numbers per body.
    #[serde(with = "preserve")]
    #[cfg_attr(test, ts(type = "Float32Array"))]
    pub(crate) commanded_poses: Float32Array,
    /// Contact forces on the object, six numbers per contact: point (m), force (N).
    #[serde(with = "preserve")]
    #[cfg_attr(test, ts(type = "Float32Array"))]
    pub(crate) contacts: Float32Array,
    /// Set while telemetry is streamed.
    pub(crate) telemetry: Option<TelemetrySample>,
    pub(crate) time: f64,
    pub(crate) running: bool,
    pub(crate) speed: f64,
    pub(crate) realtime_factor: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Cloud {
    #[serde(with = "preserve")]
    #[cfg_attr(test, ts(type = "Float32Array"))]
    pub(crate) points: Float32Array,
    /// Reconstruction of the cloud by the decoder; empty without an encoder.
    #[serde(with = "preserve")]
    #[cfg_attr(test, ts(type = "Float32Array"))]
    pub(crate) reconstruction: Float32Array,
    /// Reconstruction error and its interpretation; `None` without an encoder.
    pub(crate) familiarity: Option<String>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) enum ProgressUnit {
    Bytes,
    Steps,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Progress {
    pub(crate) label: String,
    pub(crate) done: f64,
    pub(crate) total: Option<f64>,
    pub(crate) unit: ProgressUnit,
    pub(crate) finished: bool,
}

impl Progress {
    /// Task of unknown duration.
    pub(crate) fn indeterminate(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            done: 0.0,
            total: None,
            unit: ProgressUnit::Steps,
            finished: false,
        }
    }

    /// End of the current task.
    pub(crate) fn complete() -> Self {
        Self { finished: true, ..Self::indeterminate("") }
    }
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Model {
    pub(crate) id: Option<String>,
    /// Hash of the model files.
    pub(crate) hash: Option<String>,
    pub(crate) text: String,
    pub(crate) tally: Tally,
}

/// Result of one attempt of a batch.
#[derive(Debug, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct BatchAttempt {
    pub(crate) seed: u32,
    pub(crate) pose: PlanarPose,
    pub(crate) lifted: bool,
    pub(crate) text: String,
    /// Duration of the attempt (simulated s).
    pub(crate) time: f64,
    pub(crate) final_state_hash: String,
}

/// An attempt of a batch with the counts.
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct AttemptFinished {
    /// Id of the batch.
    pub(crate) batch_id: u32,
    pub(crate) attempt: BatchAttempt,
    /// Attempts of the batch so far.
    pub(crate) batch_tally: Tally,
    /// All attempts of the current policy with the object.
    pub(crate) tally: Tally,
}

/// Result of a grasp search.
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct GraspsFound {
    /// Robust grasps, for `PlayGrasps`.
    #[cfg_attr(test, ts(type = "Array<Uint8Array>"))]
    pub(crate) grasps: Vec<ByteBuf>,
    /// Number of grasps that were tried.
    pub(crate) tried: usize,
    /// Hash of the object that the grasps belong to.
    pub(crate) object_hash: String,
}

/// Tasks of a grasp search, and its results so far.
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct SearchBatch {
    /// The object for `LoadObjectBytes`, in the first batch.
    #[cfg_attr(test, ts(type = "Uint8Array | null"))]
    pub(crate) object: Option<ByteBuf>,
    /// Tasks, for `RunSearchTask`.
    #[cfg_attr(test, ts(type = "Array<Uint8Array>"))]
    pub(crate) tasks: Vec<ByteBuf>,
    /// Estimated completed fraction, 0 to 1.
    pub(crate) fraction: f64,
    pub(crate) found: GraspsFound,
}

/// File to download.
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct SavedFile {
    pub(crate) name: String,
    pub(crate) text: String,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct Outcome {
    pub(crate) lifted: bool,
    pub(crate) text: String,
    /// Measurements that explain a failure: contacts, slip, height.
    pub(crate) evidence: Option<String>,
    pub(crate) seed: u32,
    pub(crate) pose: PlanarPose,
    /// Whether the pose differs from the pose that the seed samples.
    pub(crate) placed_by_hand: bool,
    /// Set for playback, which is not counted.
    pub(crate) playback: Option<PlaybackInfo>,
    /// Whether the user pulled the object. Disturbed attempts are not counted.
    pub(crate) disturbed: bool,
    pub(crate) final_state_hash: String,
    pub(crate) tally: Tally,
}

/// Failure with a message and a hint.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Failure {
    pub(crate) code: &'static str,
    pub(crate) message: String,
    pub(crate) hint: String,
}
