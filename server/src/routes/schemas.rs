//! OpenAPI schemas of responses. Most of these resources are stored as JSON and returned unchanged, so these
//! types are used by the description only.

use crate::store::{Artifact, EventType, Level};
use chrono::{DateTime, Utc};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Contents of a file.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct Bytes(Vec<u8>);

/// Name and version of the server.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct Version {
    /// Name of the program: always `ngf-grasp`.
    name: String,
    version: String,
}

/// Health of the server.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct Health {
    /// `ok` (liveness) or `ready` (readiness).
    status: String,
}

/// API index: URLs of resources, and limits.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct ApiIndex {
    /// Type of this object: always `api`.
    object: String,
    version: String,
    /// Whether the server runs jobs.
    jobs_enabled: bool,
    /// Whether jobs can start; false while the worker executable is being built.
    jobs_ready: bool,
    /// URLs of the resources, by name.
    urls: BTreeMap<String, String>,
    /// Maximum bytes, triangles, queued jobs and write requests per second.
    limits: BTreeMap<String, f64>,
}

/// Dataset.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct Dataset {
    /// `ds_` and the first 16 digits of the hash.
    id: String,
    /// Type of this object: always `dataset`.
    object: String,
    /// BLAKE3 (hex) of its provenance and its files.
    hash: String,
    bytes: u64,
    /// Id of the job that generated it; null for an imported dataset.
    job: Option<String>,
    created_at: DateTime<Utc>,
    /// Configuration: objects, poses, trajectories, seed and others.
    config: Map<String, Value>,
    /// By object: grasps, accepted demonstrations, and rejected ones by reason.
    summary: Map<String, Value>,
}

/// File of a dataset.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct DatasetFile {
    /// Path in the folder of the dataset, separated by slashes.
    path: String,
    bytes: u64,
    /// BLAKE3 (hex).
    blake3: String,
    url: String,
}

/// List entry of a demonstration in a dataset.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct EpisodeSchema {
    /// Index in the dataset.
    index: u64,
    /// Name of the object.
    object: String,
    /// Index of the object pose among the poses of this object.
    pose_index: u64,
    /// Object pose: x, y (m), yaw (rad).
    #[schema(min_items = 3, max_items = 3)]
    pose: [f32; 3],
    /// Index among the demonstrations at this pose.
    index_at_pose: u64,
}

/// Demonstration in the format that the page replays.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct DemonstrationSchema {
    /// Description of the demonstration.
    description: String,
    /// Hash of the scene in which it was planned.
    scene_hash: String,
    /// Hash of the object.
    object_hash: String,
    /// Name of the object.
    object_name: String,
    /// Object pose: x, y (m), yaw (rad).
    #[schema(min_items = 3, max_items = 3)]
    object_pose: [f32; 3],
    /// Rows at 30 Hz: 23 joint positions (rad), then 23 joint velocities (rad/s).
    states: Vec<Vec<f32>>,
}

/// Uploaded mesh.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct Mesh {
    /// `msh_` and the first 16 digits of the hash.
    id: String,
    /// Type of this object: always `mesh`.
    object: String,
    /// File name.
    name: String,
    /// BLAKE3 (hex) of the file.
    hash: String,
    bytes: u64,
    created_at: DateTime<Utc>,
    summary: MeshSummary,
    /// Whether the file does not tell the size: jobs with the mesh must give `size_m`, `unit` or `scale`.
    size_required: bool,
    urls: MeshUrls,
}

/// Result of the mesh inspection.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct MeshSummary {
    /// Size of the bounding box (m).
    #[schema(min_items = 3, max_items = 3)]
    extent_m: [f32; 3],
    /// Length unit of the file.
    unit: String,
    /// Why this unit was selected.
    unit_reason: String,
    /// Triangles in the file, if the mesh was simplified.
    simplified_from: Option<u64>,
    /// Triangles of the imported mesh.
    triangles: u64,
    /// Whether the surface is closed.
    watertight: bool,
    /// Number of edge-connected components.
    components: u64,
    /// Boundary edges (edges of holes).
    boundary_edges: u64,
    /// Triangles removed or flipped by the repair.
    repaired_triangles: u64,
    /// Components removed as debris: small ones around the object, or far from it.
    removed_debris: u64,
    /// Small holes that were closed.
    filled_holes: u64,
    volume_m3: f64,
    /// Solid from which volume and centre of mass are computed.
    volume_source: VolumeSource,
    /// Centre of mass at uniform density (m), in the frame of the file, but z up for glTF and a given up axis.
    #[schema(min_items = 3, max_items = 3)]
    center_of_mass_m: [f32; 3],
    /// Whether the file appears to be y-up, although its format defines no axis.
    appears_y_up: bool,
}

/// Solid from which a volume is computed.
#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
#[expect(dead_code, reason = "OpenAPI schema")]
enum VolumeSource {
    /// The closed surface.
    Surface,
    /// The closed surfaces, without open ones that enclose no volume.
    ClosedSurfaces,
    /// The union of solids that overlap.
    Union,
    /// The convex parts, because the surface is open.
    ConvexParts,
    /// The convex hull.
    Hull,
}

#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct MeshUrls {
    #[schema(rename = "self")]
    itself: String,
    file: String,
}

/// Model: built in, or trained by a job.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct Model {
    /// Folder name of a built-in model; `mdl_` and 16 hash digits of a trained one.
    id: String,
    /// Type of this object: always `model`.
    object: String,
    /// Files by name; `weights`, `start_configurations` and `config` form a policy.
    files: BTreeMap<String, ModelFile>,
    /// Model card with evaluation results; built-in models only.
    card: Option<Value>,
    /// Why the card file cannot be read.
    card_error: Option<String>,
    /// `encoder` or `policy`; trained models only.
    kind: Option<String>,
    /// Id of the job that trained it; null for an imported model.
    job: Option<String>,
    /// Training step of a checkpoint; null for the final model.
    step: Option<u64>,
    created_at: Option<DateTime<Utc>>,
    /// Parameters of the training job.
    params: Option<Map<String, Value>>,
    /// Evaluations of these files, newest first; not in lists.
    evaluations: Option<Vec<Evaluation>>,
}

/// File of a model.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct ModelFile {
    url: String,
    bytes: u64,
    /// BLAKE3 (hex).
    blake3: String,
}

/// Evaluation of a model.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct Evaluation {
    id: String,
    /// Type of this object: always `evaluation`.
    object: String,
    model_id: String,
    job: String,
    created_at: DateTime<Utc>,
    /// One report for the policy and one for each requested control condition.
    reports: Vec<EvaluationReport>,
}

/// Results of a policy on one object.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct EvaluationReport {
    /// Policy or control condition.
    policy: String,
    /// Name of the object.
    object: String,
    attempts: u64,
    lifted: u64,
    /// 95 % Wilson interval of the success rate.
    #[schema(min_items = 2, max_items = 2)]
    wilson95: [f64; 2],
    /// Number of failures by reason.
    failures: BTreeMap<String, u64>,
    /// Seed of the first attempt.
    seed: u64,
    scene_hash: String,
    object_hash: String,
    /// Hash of the model's files; null for the planner, which has none.
    model_hash: Option<String>,
    /// Orientation on the table; meshes only.
    orientation: Option<Orientation>,
}

/// Orientation of a mesh on the table.
#[derive(ToSchema)]
#[serde(rename_all = "camelCase")]
#[expect(dead_code, reason = "OpenAPI schema")]
enum Orientation {
    /// As in the file.
    AsInFile,
    /// In the stable pose with this index; 0 is the most stable.
    StablePose(u64),
}

/// Event of a job.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct Event {
    /// `evt_` and the sequence number.
    id: String,
    /// Sequence number among the events of all jobs.
    seq: i64,
    job: String,
    created_at: DateTime<Utc>,
    level: Level,
    r#type: EventType,
    /// Text for users.
    message: String,
    /// Machine-readable details.
    data: Map<String, Value>,
}

/// Checkpoint of a training, stored as a model.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct Checkpoint {
    step: u64,
    model_id: String,
    bytes: u64,
    /// Latest metrics at this step.
    metrics: Map<String, Value>,
    /// URL of the demo page with this model.
    demo_url: String,
}

/// Output file of a job.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct JobArtifact {
    #[serde(flatten)]
    artifact: Artifact,
    url: String,
}

/// Metrics as columns by name, each as long as `step`; null = not measured. `elapsed_s`: time since the job
/// started (s).
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct MetricColumns(BTreeMap<String, Vec<Option<f64>>>);
