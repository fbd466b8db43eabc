//! JSON representation of a job.

use super::kinds::{self, Kind, ParamsView};
use super::scheduler::Estimate;
use super::{Inputs, Job, JobError, Outputs, Status};
use chrono::{DateTime, TimeDelta, Utc};
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;
use worker_protocol::{Progress, Worker};

/// Job.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Job)]
pub(crate) struct JobView<'a> {
    /// `job_` and a UUID that sorts by creation time; null in a dry run.
    id: Option<&'a str>,
    /// Type of this object: always `job`.
    object: &'static str,
    kind: Kind,
    status: Status,
    /// Current phase, as named by the worker.
    phase: Option<&'a str>,
    progress: Option<ProgressView<'a>>,
    created_at: DateTime<Utc>,
    started_at: Option<DateTime<Utc>>,
    finished_at: Option<DateTime<Utc>>,
    /// Estimated end of the current phase; null if unknown.
    estimated_finish_at: Option<DateTime<Utc>>,
    updated_at: DateTime<Utc>,
    #[schema(schema_with = kinds::any_params)]
    params: ParamsView<'a>,
    seed: u64,
    name: Option<&'a str>,
    #[schema(value_type = Object)]
    metadata: &'a Map<String, Value>,
    /// Jobs with a higher priority start first.
    priority: i64,
    inputs: &'a Inputs,
    outputs: &'a Outputs,
    /// Latest value of each metric.
    #[schema(value_type = Object)]
    latest_metrics: &'a Map<String, Value>,
    /// Number of checkpoints stored so far.
    checkpoint_count: u64,
    /// Whether a resume or retry continues from stored progress.
    resumable: bool,
    error: Option<&'a JobError>,
    worker: Option<&'a Worker>,
    /// Number of workers started so far.
    attempt: u64,
    /// Estimated time and disk space; only in a dry run.
    #[serde(skip_serializing_if = "Option::is_none")]
    estimate: Option<Estimate>,
    urls: Option<Urls>,
}

/// Progress of the current phase.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = JobProgress)]
struct ProgressView<'a> {
    completed: f64,
    total: f64,
    unit: &'a str,
    fraction: f64,
    rate_per_second: Option<f64>,
    eta_seconds: Option<f64>,
}

/// URLs of the resources and actions of a job.
#[derive(Debug, Serialize, ToSchema)]
struct Urls {
    #[serde(rename = "self")]
    itself: String,
    events: String,
    stream: String,
    metrics: String,
    logs: String,
    checkpoints: String,
    artifacts: String,
    cancel: String,
    pause: String,
    resume: String,
    retry: String,
    clone: String,
    ui: String,
}

impl Job {
    /// Representation for clients.
    pub(crate) fn view(&self) -> JobView<'_> {
        let is_running = self.status == Status::Running;
        let eta =
            self.progress.as_ref().and_then(Progress::remaining_seconds).filter(|_| is_running);
        let milliseconds = eta.map(|seconds| TimeDelta::milliseconds((1e3 * seconds) as i64));
        let progress = self.progress.as_ref().map(|progress| ProgressView {
            completed: progress.completed,
            total: progress.total,
            unit: &progress.unit,
            fraction: progress.fraction(),
            rate_per_second: progress.rate_per_second,
            eta_seconds: eta,
        });
        let url = |suffix: &str| format!("/api/v1/jobs/{}{suffix}", self.id);
        JobView {
            id: Some(&self.id),
            object: "job",
            kind: self.kind(),
            status: self.status,
            phase: self.phase.as_deref(),
            progress,
            created_at: self.created_at,
            started_at: self.started_at,
            finished_at: self.finished_at,
            estimated_finish_at: milliseconds
                .and_then(|left| self.updated_at.checked_add_signed(left)),
            updated_at: self.updated_at,
            params: ParamsView(&self.params),
            seed: self.params.seed(),
            name: self.name.as_deref(),
            metadata: &self.metadata,
            priority: self.priority,
            inputs: &self.inputs,
            outputs: &self.outputs,
            latest_metrics: &self.latest_metrics,
            checkpoint_count: self.checkpoint_count,
            resumable: self.is_resumable(),
            error: self.error.as_ref(),
            worker: self.worker.as_ref(),
            attempt: self.attempt,
            estimate: None,
            urls: Some(Urls {
                itself: url(""),
                events: url("/events"),
                stream: url("/stream"),
                metrics: url("/metrics"),
                logs: url("/logs"),
                checkpoints: url("/checkpoints"),
                artifacts: url("/artifacts"),
                cancel: url("/cancel"),
                pause: url("/pause"),
                resume: url("/resume"),
                retry: url("/retry"),
                clone: url("/clone"),
                ui: format!("/jobs/#jobs/{}", self.id),
            }),
        }
    }

    /// Dry run: the job as it would be created, with an estimate and without id and URLs.
    pub(crate) fn preview(&self, estimate: Estimate) -> JobView<'_> {
        JobView { id: None, urls: None, estimate: Some(estimate), ..self.view() }
    }
}
