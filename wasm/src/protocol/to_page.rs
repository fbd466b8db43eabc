//! What the worker says.

use super::PlanarPose;
use crate::statistics::Tally;
use geometry::brought::{Because, Stands};
use geometry::mesh::{Mesh, Unit};
use js_sys::{Float32Array, Uint32Array};
use rollout::Moment;
use serde::Serialize;
use serde_wasm_bindgen::preserve;

/// To the page.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "camelCase")]
pub(crate) enum FromWorker {
    Ready(Ready),
    Object(ObjectLoaded),
    Frame(Frame),
    /// The moments of the attempt so far, tick by tick.
    Course {
        moments: Vec<Moment>,
    },
    Cloud(Cloud),
    Progress(Progress),
    Model(Model),
    Verdict(Verdict),
    /// An attempt of a batch has ended.
    Attempted(Attempted),
    /// A batch has ended.
    BatchOver {
        run: u32,
    },
    /// A search has ended.
    Found(Found),
    File(File),
    Failure(Failure),
}

/// A surface.
#[derive(Serialize)]
pub(crate) struct Shape {
    #[serde(with = "preserve")]
    positions: Float32Array,
    #[serde(with = "preserve")]
    indices: Uint32Array,
}

impl Shape {
    pub(crate) fn of(mesh: &Mesh) -> Self {
        let positions: Vec<f32> = mesh.vertices.iter().flat_map(|v| v.to_array()).collect();
        let indices = Uint32Array::from(mesh.triangles.as_flattened());
        Self { positions: Float32Array::from(positions.as_slice()), indices }
    }
}

/// A part of the robot: it moves with the body of this index.
#[derive(Serialize)]
pub(crate) struct Link {
    pub(crate) body: usize,
    pub(crate) color: &'static str,
    pub(crate) shape: Shape,
}

#[derive(Serialize)]
pub(crate) struct Table {
    pub(crate) center: [f32; 3],
    pub(crate) half: [f32; 3],
}

#[derive(Serialize)]
pub(crate) struct Rectangle {
    pub(crate) x: [f32; 2],
    pub(crate) y: [f32; 2],
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct DepthCamera {
    pub(crate) position: [f32; 3],
    pub(crate) target: [f32; 3],
    pub(crate) hfov_deg: f32,
    pub(crate) aspect: f32,
}

#[derive(Serialize)]
pub(crate) struct BuiltIn {
    pub(crate) name: &'static str,
    pub(crate) label: String,
    pub(crate) shape: Shape,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Ready {
    pub(crate) links: Vec<Link>,
    pub(crate) table: Table,
    pub(crate) workspace: Rectangle,
    pub(crate) camera: DepthCamera,
    pub(crate) objects: Vec<BuiltIn>,
    pub(crate) joints: Vec<Joint>,
    /// Of scene file and robot: what it is the same for, ends the same.
    pub(crate) scene: String,
    /// The longest mesh file that is read.
    pub(crate) most_bytes: usize,
}

/// A joint, the body that it moves, and its limits (rad).
#[derive(Serialize)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) body: usize,
    pub(crate) lower: f32,
    pub(crate) upper: f32,
}

/// What was found out about an object.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Report {
    pub(crate) extent_cm: [f32; 3],
    pub(crate) mass_kg: f32,
    pub(crate) triangles: usize,
    pub(crate) watertight: bool,
    pub(crate) parts: usize,
    pub(crate) unit: Option<Unit>,
    pub(crate) reason: Option<String>,
    /// Sides that hold it, and how it stands.
    pub(crate) sides: usize,
    pub(crate) stands: Option<Stands>,
    /// Why it stands so; only for uploads.
    pub(crate) because: Option<Because>,
    /// Whether the hand gets round it, and hold of it.
    pub(crate) fits: String,
    pub(crate) notes: Vec<String>,
}

#[derive(Serialize)]
pub(crate) struct ObjectLoaded {
    pub(crate) name: Option<String>,
    /// Of shape, mass and friction.
    pub(crate) hash: String,
    pub(crate) label: String,
    pub(crate) shape: Shape,
    pub(crate) hulls: Vec<Shape>,
    pub(crate) report: Report,
    /// Attempts so far with this object.
    pub(crate) tally: Tally,
}

/// What is played in place of an attempt of whoever acts, in words.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Played {
    pub(crate) what: String,
    /// Said while the hand closes.
    pub(crate) closes: &'static str,
    /// The state that it is to end in, if that was recorded.
    pub(crate) end: Option<String>,
}

/// Phases of an attempt; `Idle` is before the first and after a reset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) enum Phase {
    Idle,
    Approach,
    Policy,
    Lift,
    Hold,
    Verdict,
}

#[derive(Serialize)]
pub(crate) struct Frame {
    /// Seven numbers a body: position, quaternion; the robot's bodies, then the object.
    #[serde(with = "preserve")]
    pub(crate) poses: Float32Array,
    pub(crate) pose: PlanarPose,
    /// The seed that the pose was drawn from, unless the object was placed by hand.
    pub(crate) drawn: Option<u32>,
    pub(crate) played: Option<Played>,
    pub(crate) phase: Phase,
    /// Which tick is shown, how many there are, and the phases so far, each with its first one.
    pub(crate) tick: usize,
    pub(crate) ticks: usize,
    pub(crate) marks: Vec<(Phase, usize)>,
    /// Commanded positions (rad) of all joints.
    #[serde(with = "preserve")]
    pub(crate) joints: Float32Array,
    /// Where they would have the robot's bodies: seven numbers each.
    #[serde(with = "preserve")]
    pub(crate) target: Float32Array,
    /// What presses on the object, six numbers each: where (m), and with what force (N).
    #[serde(with = "preserve")]
    pub(crate) contacts: Float32Array,
    /// If it is watched.
    pub(crate) moment: Option<Moment>,
    pub(crate) time: f64,
    pub(crate) running: bool,
    pub(crate) factor: f64,
    pub(crate) measured: Option<f64>,
}

#[derive(Serialize)]
pub(crate) struct Cloud {
    #[serde(with = "preserve")]
    pub(crate) points: Float32Array,
    /// What the encoder makes of it; nothing where no encoder was asked.
    #[serde(with = "preserve")]
    pub(crate) reconstruction: Float32Array,
    /// How far that is from the cloud, and what that means, in words; none where no encoder was asked.
    pub(crate) likeness: Option<String>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) enum Amount {
    Bytes,
    Steps,
}

#[derive(Serialize)]
pub(crate) struct Progress {
    pub(crate) label: String,
    pub(crate) done: f64,
    pub(crate) total: Option<f64>,
    pub(crate) unit: Amount,
    pub(crate) finished: bool,
}

impl Progress {
    /// Something that takes its time, nobody knows how long.
    pub(crate) fn begin(label: impl Into<String>) -> Self {
        Self { label: label.into(), done: 0.0, total: None, unit: Amount::Steps, finished: false }
    }

    /// Nothing more to wait for.
    pub(crate) fn end() -> Self {
        Self { finished: true, ..Self::begin("") }
    }
}

#[derive(Serialize)]
pub(crate) struct Model {
    pub(crate) id: Option<String>,
    /// Of its files.
    pub(crate) hash: Option<String>,
    pub(crate) words: String,
    pub(crate) tally: Tally,
}

/// How one attempt of a batch ended.
#[derive(Serialize)]
pub(crate) struct Attempted {
    /// Of the batch.
    pub(crate) run: u32,
    pub(crate) seed: u32,
    pub(crate) pose: PlanarPose,
    pub(crate) lifted: bool,
    pub(crate) words: String,
    /// Simulated seconds.
    pub(crate) time: f64,
    pub(crate) hash: String,
    /// Of the batch so far.
    pub(crate) row: Tally,
    /// Of all attempts with the object.
    pub(crate) tally: Tally,
}

/// What a search found.
#[derive(Serialize)]
pub(crate) struct Found {
    pub(crate) words: String,
    /// Reliable grasps, for `Follow`.
    pub(crate) grasps: String,
    /// Hash of the object that they are of.
    pub(crate) object: String,
    pub(crate) count: usize,
}

/// A file to be saved.
#[derive(Serialize)]
pub(crate) struct File {
    pub(crate) name: String,
    pub(crate) text: String,
}

#[derive(Serialize)]
pub(crate) struct Verdict {
    pub(crate) lifted: bool,
    pub(crate) words: String,
    pub(crate) seed: u32,
    pub(crate) pose: PlanarPose,
    /// Whether the object was placed by hand, not where the seed puts it.
    pub(crate) placed: bool,
    /// What was played, if something was: it does not count.
    pub(crate) played: Option<Played>,
    /// Whether somebody pulled at the object: then it does not count either.
    pub(crate) pulled: bool,
    pub(crate) hash: String,
    pub(crate) tally: Tally,
}

/// What went wrong, why, and what to do.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Failure {
    pub(crate) code: &'static str,
    pub(crate) cause: String,
    pub(crate) cure: String,
}
