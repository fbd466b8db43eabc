//! Estimates of the time and disk space of a job: scaled from a comparable finished job, or from reference
//! measurements.

use super::JobScheduler;
use crate::job::{DatasetParams, Job, Params, Status};
use crate::store::{Filter, StoreError};
use dataset::config::DatasetConfig;
use serde::Serialize;
use utoipa::ToSchema;

/// Estimated cost of a job.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub(crate) struct Estimate {
    /// Run time (s).
    pub(crate) seconds: f64,
    /// Disk space (bytes).
    pub(crate) bytes: f64,
    /// Finished job from which the run time is scaled; null if it is based on reference measurements with two
    /// cores.
    pub(crate) based_on_job_id: Option<String>,
}

/// Maximum number of finished jobs that are searched for a comparable one.
const MAX_COMPARED_JOBS: i64 = 50;

/// Reference run times (s), measured on two cores (2026). Preset `variants` (46,400 clouds, 4,400
/// demonstrations, 8 variants): 18 minutes; `paper`: 50 minutes. 160,000 policy steps at batch size 128,
/// including validation attempts: 23 (NGF), 50 (large MLP) and 4 (MLP) minutes. 300 attempts: 95 to 115 s.
mod seconds {
    /// Grasp search for a mesh; built-in objects have stored grasps.
    pub(super) const GRASP_SEARCH: f64 = 120.0;
    /// Grasp transfer from an object to one of its variants, including trials.
    pub(super) const GRASP_TRANSFER: f64 = 75.0;
    pub(super) const DEMONSTRATION: f64 = 0.06;
    pub(super) const CLOUD: f64 = 0.0022;
    pub(super) const ENCODER_EXAMPLE: f64 = 0.0005;
    pub(super) const NGF_EXAMPLE: f64 = 0.00007;
    pub(super) const LARGE_MLP_EXAMPLE: f64 = 0.00015;
    pub(super) const MLP_EXAMPLE: f64 = 0.000014;
    pub(super) const ATTEMPT: f64 = 0.35;
    pub(super) const MESH: f64 = 5.0;
}

/// Reference disk space (bytes).
mod bytes {
    pub(super) const DEMONSTRATION: f64 = 22_000.0;
    pub(super) const CLOUD: f64 = 18_400.0;
    /// Model with its training checkpoint.
    pub(super) const MODEL: f64 = 150e6;
    /// One stored checkpoint; every checkpoint is kept.
    pub(super) const CHECKPOINT: f64 = 12.6e6;
    pub(super) const SMALL_CHECKPOINT: f64 = 1.7e6;
    pub(super) const ATTEMPT: f64 = 200.0;
    pub(super) const MESH: f64 = 5e6;
}

impl JobScheduler {
    /// Estimates the cost of a job before it starts.
    pub(crate) async fn estimate(&self, job: &Job) -> Result<Estimate, StoreError> {
        let filter = Filter {
            status: vec![Status::Succeeded],
            kind: vec![job.kind],
            limit: MAX_COMPARED_JOBS,
            ..Filter::default()
        };
        let (seconds, bytes) = reference_cost(&job.params);
        let scaled_from = |old: &Job| {
            let duration = (old.finished_at? - old.started_at?).as_seconds_f64();
            // The duration of an interrupted job includes waiting times.
            let is_comparable = old.attempt == 1 && is_comparable(&old.params, &job.params);
            is_comparable.then(|| duration * seconds / reference_cost(&old.params).0)
        };
        let jobs = self.store.jobs(&filter).await?;
        Ok(match jobs.iter().find_map(|old| Some((old, scaled_from(old)?))) {
            Some((old, seconds)) => {
                Estimate { seconds, bytes, based_on_job_id: Some(old.id.clone()) }
            }
            None => Estimate { seconds, bytes, based_on_job_id: None },
        })
    }
}

/// Whether the duration of one job predicts the other's, scaled by their reference costs.
fn is_comparable(a: &Params, b: &Params) -> bool {
    match (a, b) {
        (Params::Dataset(a), Params::Dataset(b)) => {
            a.preset == b.preset && a.object_params == b.object_params
        }
        (Params::Policy(a), Params::Policy(b)) => a.policy == b.policy,
        _ => true,
    }
}

/// Run time (s) and disk space (bytes) by the reference measurements.
fn reference_cost(params: &Params) -> (f64, f64) {
    let examples = |steps: Option<u64>, batch: Option<usize>| {
        steps.unwrap_or_default() as f64 * batch.unwrap_or_default() as f64
    };
    match params {
        Params::Dataset(params) => dataset_cost(params),
        Params::Encoder(params) => {
            let examples = examples(params.training.steps, params.training.batch);
            (seconds::ENCODER_EXAMPLE * examples, bytes::MODEL)
        }
        Params::Policy(params) => {
            let training = &params.training;
            let (seconds_per_example, bytes_per_checkpoint) = match params.policy.as_str() {
                "mlp-large-pcd" => (seconds::LARGE_MLP_EXAMPLE, bytes::CHECKPOINT),
                small if small.starts_with("mlp") => {
                    (seconds::MLP_EXAMPLE, bytes::SMALL_CHECKPOINT)
                }
                _ => (seconds::NGF_EXAMPLE, bytes::CHECKPOINT),
            };
            let checkpoint_every = training.checkpoint_every.unwrap_or(u64::MAX).max(1);
            let checkpoints = training.steps.unwrap_or_default() / checkpoint_every;
            let bytes = bytes::MODEL + bytes_per_checkpoint * checkpoints as f64;
            (seconds_per_example * examples(training.steps, training.batch), bytes)
        }
        Params::Evaluation(params) => {
            let conditions = if params.controls { 5.0 } else { 1.0 };
            let attempts = conditions * params.attempts as f64;
            (seconds::ATTEMPT * attempts, bytes::ATTEMPT * attempts)
        }
        Params::Mesh(_) => (seconds::MESH, bytes::MESH),
    }
}

/// Run time (s) and disk space (bytes) of a dataset generation.
fn dataset_cost(params: &DatasetParams) -> (f64, f64) {
    let Some(config) = DatasetConfig::preset(&params.preset, params.seed) else {
        return (0.0, 0.0);
    };
    let is_single_object =
        params.object_params.object.is_some() || params.object_params.mesh_id.is_some();
    let count = |objects: usize| if is_single_object { 1.0 } else { objects as f64 };
    let poses = count(config.objects.len()) * config.poses as f64;
    let demonstrations = poses * config.trajectories as f64;
    let clouds = poses * config.num_azimuths as f64
        + count(config.encoder_objects.len()) * config.encoder_clouds as f64;
    let variants = config.objects.iter().filter(|name| name.contains('.')).count();
    let grasps = match &params.object_params {
        object if object.mesh_id.is_some() => seconds::GRASP_SEARCH,
        object if object.object.is_some() => 0.0,
        _ => seconds::GRASP_TRANSFER * variants as f64,
    };
    let seconds = grasps + seconds::DEMONSTRATION * demonstrations + seconds::CLOUD * clouds;
    (seconds, bytes::DEMONSTRATION * demonstrations + bytes::CLOUD * clouds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Kind;
    use serde_json::json;

    #[test]
    fn estimate_grows_with_the_dataset_preset() {
        let of = |preset: &str| {
            let given = json!({ "preset": preset });
            let params = Params::resolve(Kind::DatasetGenerate, given.as_object().unwrap().clone());
            reference_cost(&params.unwrap())
        };
        let all = ["smoke", "small", "variants", "paper"].map(of);
        assert!(all.windows(2).all(|pair| pair[0].0 < pair[1].0), "{all:?}");
        // Measured: 18 and 50 minutes, 1.05 GB.
        let (seconds, bytes) = of("variants");
        assert!((700.0..1600.0).contains(&seconds) && (0.5e9..2e9).contains(&bytes), "{seconds}");
        let (seconds, _) = of("paper");
        assert!((2000.0..4500.0).contains(&seconds), "{seconds}");
    }

    #[test]
    fn estimate_grows_with_the_network_size() {
        let of = |policy: &str| {
            let given = json!({
                "dataset_id": "dst_1", "encoder_id": "mdl_1", "steps": 160_000, "policy": policy
            });
            let params = Params::resolve(Kind::PolicyTrain, given.as_object().unwrap().clone());
            reference_cost(&params.unwrap()).0 / 60.0
        };
        // Measured: 4, 23 and 50 minutes.
        for (policy, minutes) in [("mlp-pos", 4.0), ("ngf-pcd", 23.0), ("mlp-large-pcd", 50.0)] {
            assert!((0.7..1.5).contains(&(of(policy) / minutes)), "{policy}: {}", of(policy));
        }
    }

    #[test]
    fn disk_estimate_includes_every_checkpoint() {
        let of = |checkpoint_every: u64| {
            let given = json!({
                "dataset_id": "dst_1", "encoder_id": "mdl_1", "steps": 160_000,
                "checkpoint_every": checkpoint_every,
            });
            let params = Params::resolve(Kind::PolicyTrain, given.as_object().unwrap().clone());
            reference_cost(&params.unwrap()).1
        };
        assert!((of(80_000) - of(160_000) - bytes::CHECKPOINT).abs() < 1.0);
        assert!(of(100) > 20e9, "{}", of(100));
    }
}
