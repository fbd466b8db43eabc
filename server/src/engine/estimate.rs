//! How long a job will take, and how much of the disk: as one like it took here, or as it took where it was written.

use super::Engine;
use crate::job::{DatasetParams, Job, Params, Status};
use crate::store::{Filter, StoreError};
use dataset::config::DatasetConfig;
use serde::Serialize;
use utoipa::ToSchema;

/// What a job will take, roughly.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub(crate) struct Estimate {
    /// Seconds of work.
    pub(crate) seconds: f64,
    /// Bytes on the disk.
    pub(crate) bytes: f64,
    /// The job that took as long here, in proportion; null if the number is of another machine, with two cores.
    pub(crate) like_job_id: Option<String>,
}

/// Jobs that are looked through for one that is like another.
const LOOKED_THROUGH: i64 = 50;

/// On two cores of 2026 (preset `variants` of 46,400 clouds, 4,400 demonstrations and 8 variants in 18 minutes, `paper` in
/// 50; 160,000 steps of a policy at batch 128, with the attempts on the way, in 23, 50 and 4 minutes; 300 attempts in 95
/// to 115 seconds).
mod seconds {
    /// Of a mesh; objects of the project have their grasps.
    pub(super) const SEARCH_OF_GRASPS: f64 = 120.0;
    /// From an object to a variant of it, where they are tried again.
    pub(super) const GRASPS_CARRIED_OVER: f64 = 75.0;
    pub(super) const DEMONSTRATION: f64 = 0.06;
    pub(super) const CLOUD: f64 = 0.0022;
    pub(super) const EXAMPLE_OF_ENCODER: f64 = 0.0005;
    pub(super) const EXAMPLE_OF_NGF: f64 = 0.00007;
    pub(super) const EXAMPLE_OF_LARGE_MLP: f64 = 0.00015;
    pub(super) const EXAMPLE_OF_MLP: f64 = 0.000014;
    pub(super) const ATTEMPT: f64 = 0.35;
    pub(super) const MESH: f64 = 5.0;
}

/// On the disk.
mod bytes {
    pub(super) const DEMONSTRATION: f64 = 22_000.0;
    pub(super) const CLOUD: f64 = 18_400.0;
    /// With what it goes on from.
    pub(super) const MODEL: f64 = 150e6;
    /// Each model on the way is kept, to be tried.
    pub(super) const CHECKPOINT: f64 = 12.6e6;
    pub(super) const CHECKPOINT_OF_SMALL: f64 = 1.7e6;
    pub(super) const ATTEMPT: f64 = 200.0;
    pub(super) const MESH: f64 = 5e6;
}

impl Engine {
    /// What a job will take.
    pub(crate) async fn estimate(&self, job: &Job) -> Result<Estimate, StoreError> {
        let filter = Filter {
            status: vec![Status::Succeeded],
            kind: vec![job.kind],
            limit: LOOKED_THROUGH,
            ..Filter::default()
        };
        let (seconds, bytes) = standard(&job.params);
        let of_old = |old: &Job| {
            let took = (old.finished_at? - old.started_at?).as_seconds_f64();
            // One that was interrupted says little about the next.
            let is_like = old.attempt == 1 && is_like(&old.params, &job.params);
            is_like.then(|| took * seconds / standard(&old.params).0)
        };
        let jobs = self.store.jobs(&filter).await?;
        Ok(match jobs.iter().find_map(|old| Some((old, of_old(old)?))) {
            Some((old, seconds)) => Estimate { seconds, bytes, like_job_id: Some(old.id.clone()) },
            None => Estimate { seconds, bytes, like_job_id: None },
        })
    }
}

/// Whether the time of one tells that of the other.
fn is_like(one: &Params, other: &Params) -> bool {
    match (one, other) {
        (Params::Dataset(one), Params::Dataset(other)) => {
            one.preset == other.preset && one.subject == other.subject
        }
        (Params::Policy(one), Params::Policy(other)) => one.policy == other.policy,
        _ => true,
    }
}

/// Seconds and bytes as they were measured elsewhere.
fn standard(params: &Params) -> (f64, f64) {
    let examples = |steps: Option<u64>, batch: Option<usize>| {
        steps.unwrap_or_default() as f64 * batch.unwrap_or_default() as f64
    };
    match params {
        Params::Dataset(params) => of_dataset(params),
        Params::Encoder(params) => {
            let examples = examples(params.course.steps, params.course.batch);
            (seconds::EXAMPLE_OF_ENCODER * examples, bytes::MODEL)
        }
        Params::Policy(params) => {
            let course = &params.course;
            let (each, kept) = match params.policy.as_str() {
                "mlp-large-pcd" => (seconds::EXAMPLE_OF_LARGE_MLP, bytes::CHECKPOINT),
                small if small.starts_with("mlp") => {
                    (seconds::EXAMPLE_OF_MLP, bytes::CHECKPOINT_OF_SMALL)
                }
                _ => (seconds::EXAMPLE_OF_NGF, bytes::CHECKPOINT),
            };
            let every = course.checkpoint.unwrap_or(u64::MAX).max(1);
            let checkpoints = course.steps.unwrap_or_default() / every;
            let bytes = bytes::MODEL + kept * checkpoints as f64;
            (each * examples(course.steps, course.batch), bytes)
        }
        Params::Evaluation(params) => {
            let rounds = if params.controls { 5.0 } else { 1.0 };
            let attempts = rounds * params.attempts as f64;
            (seconds::ATTEMPT * attempts, bytes::ATTEMPT * attempts)
        }
        Params::Mesh(_) => (seconds::MESH, bytes::MESH),
    }
}

fn of_dataset(params: &DatasetParams) -> (f64, f64) {
    let Some(config) = DatasetConfig::preset(&params.preset, params.seed) else {
        return (0.0, 0.0);
    };
    let is_one = params.subject.object.is_some() || params.subject.mesh_id.is_some();
    let of = |objects: usize| if is_one { 1.0 } else { objects as f64 };
    let poses = of(config.objects.len()) * config.poses as f64;
    let demonstrations = poses * config.trajectories as f64;
    let clouds = poses * config.turns as f64
        + of(config.encoder_objects.len()) * config.encoder_clouds as f64;
    let variants = config.objects.iter().filter(|name| name.contains('.')).count();
    let grasps = match &params.subject {
        subject if subject.mesh_id.is_some() => seconds::SEARCH_OF_GRASPS,
        subject if subject.object.is_some() => 0.0,
        _ => seconds::GRASPS_CARRIED_OVER * variants as f64,
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
    fn more_work_takes_longer() {
        let of = |preset: &str| {
            let given = json!({ "preset": preset });
            let params = Params::resolve(Kind::DatasetGenerate, given.as_object().unwrap().clone());
            standard(&params.unwrap())
        };
        let all = ["smoke", "small", "variants", "paper"].map(of);
        assert!(all.windows(2).all(|pair| pair[0].0 < pair[1].0), "{all:?}");
        // As it was measured: 18 and 50 minutes, and 1.05 GB.
        let (seconds, bytes) = of("variants");
        assert!((700.0..1600.0).contains(&seconds) && (0.5e9..2e9).contains(&bytes), "{seconds}");
        let (seconds, _) = of("paper");
        assert!((2000.0..4500.0).contains(&seconds), "{seconds}");
    }

    #[test]
    fn a_larger_network_takes_longer() {
        let of = |policy: &str| {
            let given = json!({
                "dataset_id": "dst_1", "encoder_id": "mdl_1", "steps": 160_000, "policy": policy
            });
            let params = Params::resolve(Kind::PolicyTrain, given.as_object().unwrap().clone());
            standard(&params.unwrap()).0 / 60.0
        };
        // As it was measured, in minutes: 4, 23 and 50.
        for (policy, minutes) in [("mlp-pos", 4.0), ("ngf-pcd", 23.0), ("mlp-large-pcd", 50.0)] {
            assert!((0.7..1.5).contains(&(of(policy) / minutes)), "{policy}: {}", of(policy));
        }
    }

    #[test]
    fn every_checkpoint_of_a_training_stays_on_the_disk() {
        let of = |checkpoint: u64| {
            let given = json!({
                "dataset_id": "dst_1", "encoder_id": "mdl_1", "steps": 160_000, "checkpoint": checkpoint
            });
            let params = Params::resolve(Kind::PolicyTrain, given.as_object().unwrap().clone());
            standard(&params.unwrap()).1
        };
        assert!((of(80_000) - of(160_000) - bytes::CHECKPOINT).abs() < 1.0);
        assert!(of(100) > 20e9, "{}", of(100));
    }
}
