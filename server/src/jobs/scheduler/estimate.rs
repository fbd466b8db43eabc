//! Estimates of the time and disk space of a job: scaled from a comparable finished job, or from reference
//! measurements.

use super::JobScheduler;
use crate::jobs::kinds::Cost;
use crate::jobs::{Job, Status};
use crate::store::{Filter, StoreError};
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

impl JobScheduler {
    /// Estimates the cost of a job before it starts.
    pub(crate) async fn estimate(&self, job: &Job) -> Result<Estimate, StoreError> {
        let filter = Filter {
            status: vec![Status::Succeeded],
            kind: vec![job.kind()],
            limit: MAX_COMPARED_JOBS,
            ..Filter::default()
        };
        let Cost { seconds, bytes } = job.params.cost();
        let scaled_from = |old: &Job| {
            let duration = (old.finished_at? - old.started_at?).as_seconds_f64();
            // The duration of an interrupted job includes waiting times.
            let is_comparable = old.attempt == 1 && old.params.is_comparable(&job.params);
            is_comparable.then(|| duration * seconds / old.params.cost().seconds)
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
