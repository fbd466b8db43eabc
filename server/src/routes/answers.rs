//! What answers hold, for their description: most are written down as JSON when a job or an upload makes them, and read
//! as they are.

use crate::store::{Artifact, Level, Type};
use chrono::{DateTime, Utc};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// A file.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Bytes(Vec<u8>);

/// Which program answers.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Version {
    /// Always `ngf-grasp`.
    name: String,
    version: String,
}

/// Whether the program can serve.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Health {
    /// `ok`, or `ready`.
    status: String,
}

/// What there is.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Api {
    /// Always `api`.
    object: String,
    version: String,
    /// Whether it does jobs.
    jobs_enabled: bool,
    urls: BTreeMap<String, String>,
    /// Bytes, triangles, jobs and changes a second at most.
    limits: BTreeMap<String, f64>,
}

/// A dataset.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Dataset {
    /// `ds_` and the beginning of its hash.
    id: String,
    /// Always `dataset`.
    object: String,
    /// BLAKE3 of what it was made from and of its files.
    hash: String,
    bytes: u64,
    /// The job that made it.
    job: String,
    created_at: DateTime<Utc>,
    /// What it was told: objects, poses, trajectories, seed and the like.
    config: Map<String, Value>,
    /// By object: grasps, demonstrations kept, and why others were not.
    summary: Map<String, Value>,
}

/// A demonstration of a dataset, in a list.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Episode {
    /// Its number in the dataset.
    index: u64,
    /// Name of the object.
    object: String,
    /// Number of the object's pose among those of this object.
    pose_index: u64,
    /// x, y (m) and yaw (rad) of the object.
    pose: [f32; 3],
    /// Its number among those of this pose.
    nth: u64,
}

/// A demonstration as the page plays it.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Demonstration {
    /// What it is, for people.
    demonstration: String,
    /// Hash of the scene that it was made in.
    scene: String,
    /// Hash of the object.
    object: String,
    /// Name of the object.
    name: String,
    /// x, y (m) and yaw (rad) of the object.
    pose: [f32; 3],
    /// 30 rows a second: 23 joint positions (rad), then as many velocities (rad/s).
    states: Vec<Vec<f32>>,
}

/// A mesh that was uploaded.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Mesh {
    /// `msh_` and the beginning of its hash.
    id: String,
    /// Always `mesh`.
    object: String,
    /// Name of the file.
    name: String,
    /// BLAKE3 of the file.
    hash: String,
    bytes: u64,
    created_at: DateTime<Utc>,
    report: MeshReport,
    urls: MeshUrls,
}

/// What was found out about a mesh.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct MeshReport {
    /// Sides of the bounding box (m).
    extent_m: [f32; 3],
    /// The unit that was taken.
    unit: String,
    /// Why it was taken.
    reason: String,
    /// Triangles in the file, if they were too many to keep.
    simplified_from: Option<u64>,
    triangles: u64,
    /// Whether the surface is closed.
    watertight: bool,
    /// Pieces that share no edge.
    components: u64,
    /// Edges at holes.
    open_edges: u64,
    /// Triangles that were left out or turned round.
    mended_triangles: u64,
    volume_m3: f64,
    /// Whether the volume is that of the convex hull, because the surface bounds none.
    weighed_by_hull: bool,
}

#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct MeshUrls {
    #[schema(rename = "self")]
    itself: String,
    file: String,
}

/// A model: one that the server was given, or one that a job made.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Model {
    /// Of a job's model `mdl_` and the beginning of its hash.
    id: String,
    /// Always `model`.
    object: String,
    /// By name; `weights`, `starts` and `config` are what acts.
    files: BTreeMap<String, ModelFile>,
    /// Of a model that the server was given: what was counted of it.
    card: Option<Value>,
    /// Why there is no card, though there is a file.
    card_error: Option<String>,
    /// Of a job's model: `encoder` or `policy`.
    kind: Option<String>,
    /// The job that made it.
    job: Option<String>,
    /// Steps of the training after which it was written, if that went on.
    step: Option<u64>,
    created_at: Option<DateTime<Utc>>,
    /// What the training was told.
    params: Option<Map<String, Value>>,
    /// What jobs counted of these files, newest first; not in a list.
    evaluations: Option<Vec<Evaluation>>,
}

/// A file of a model.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct ModelFile {
    url: String,
    bytes: u64,
    /// BLAKE3, hex.
    blake3: String,
}

/// What a job counted of a model.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct Evaluation {
    id: String,
    /// Always `evaluation`.
    object: String,
    model_id: String,
    job: String,
    created_at: DateTime<Utc>,
    /// One for each who acted: the policy and, where asked, the controls.
    reports: Vec<Counted>,
}

/// Attempts with an object.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct Counted {
    /// Who acted.
    policy: String,
    /// Name of the object.
    object: String,
    attempts: u64,
    lifted: u64,
    /// Wilson's interval of the share, 95 %.
    wilson95: [f64; 2],
    /// How many failed for which reason.
    failures: BTreeMap<String, u64>,
    /// Seed of the first attempt.
    seed: u64,
    scene_hash: String,
    object_hash: String,
    /// Hash of the model's files.
    model_hash: String,
    /// Of a mesh: how it stood.
    stands: Option<Stands>,
}

/// How a mesh stands.
#[derive(ToSchema)]
#[serde(rename_all = "camelCase")]
#[expect(dead_code, reason = "only described")]
enum Stands {
    /// As its file has it.
    AsInFile,
    /// On one of the sides that hold it, the steadiest being 0.
    On(u64),
}

/// Something that happened to a job.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Event {
    /// `evt_` and its number.
    id: String,
    /// Its number among the events of all jobs.
    seq: i64,
    job: String,
    created_at: DateTime<Utc>,
    level: Level,
    r#type: Type,
    /// For people.
    message: String,
    /// For programs.
    data: Map<String, Value>,
}

/// A model that a training wrote on its way.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Checkpoint {
    step: u64,
    model_id: String,
    bytes: u64,
    /// What was measured last.
    metrics: Map<String, Value>,
    /// The page with it.
    demo_url: String,
}

/// A file of a job.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct FileOfJob {
    #[serde(flatten)]
    artifact: Artifact,
    url: String,
}

/// Columns of numbers by name, all as long as `step`: null where nothing was measured; `wall` is seconds since the job
/// began.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Columns(BTreeMap<String, Vec<Option<f64>>>);
