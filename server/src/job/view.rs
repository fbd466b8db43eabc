//! A job as whoever asks sees it.

use super::params::schema;
use super::{Failure, Inputs, Job, Kind, Outputs, Params, Progress, Status, Worker};
use crate::engine::Estimate;
use chrono::{DateTime, TimeDelta, Utc};
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;

/// A job.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Job)]
pub(crate) struct JobView<'a> {
    /// `job_` and a number that sorts by time; null in a dry run.
    id: Option<&'a str>,
    /// Always `job`.
    object: &'static str,
    kind: Kind,
    status: Status,
    /// What it is at, in the words of its program.
    phase: Option<&'a str>,
    progress: Option<ProgressView<'a>>,
    created_at: DateTime<Utc>,
    started_at: Option<DateTime<Utc>>,
    finished_at: Option<DateTime<Utc>>,
    /// When the phase will be over, if that can be said.
    estimated_finish_at: Option<DateTime<Utc>>,
    updated_at: DateTime<Utc>,
    #[schema(schema_with = schema::any)]
    params: &'a Params,
    seed: u64,
    name: Option<&'a str>,
    #[schema(value_type = Object)]
    metadata: &'a Map<String, Value>,
    /// Higher ones begin first.
    priority: i64,
    inputs: &'a Inputs,
    outputs: &'a Outputs,
    /// The last metrics.
    #[schema(value_type = Object)]
    latest_metrics: &'a Map<String, Value>,
    /// Models that it wrote on its way.
    checkpoint_count: u64,
    /// Whether it goes on from where it was when it is resumed or tried again.
    resumable: bool,
    error: Option<&'a Failure>,
    worker: Option<&'a Worker>,
    /// How often a process began with it.
    attempt: u64,
    /// What it would take; only in a dry run.
    #[serde(skip_serializing_if = "Option::is_none")]
    estimate: Option<Estimate>,
    urls: Option<Urls>,
}

/// How far a job is.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = ProgressOfJob)]
struct ProgressView<'a> {
    completed: f64,
    total: f64,
    unit: &'a str,
    fraction: f64,
    rate_per_second: Option<f64>,
    eta_seconds: Option<f64>,
}

/// Where else to look, and what to ask for.
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
    /// As whoever asks sees it.
    pub(crate) fn view(&self) -> JobView<'_> {
        let is_running = self.status == Status::Running;
        let eta = self.progress.as_ref().and_then(Progress::seconds_left).filter(|_| is_running);
        let milliseconds = eta.map(|seconds| TimeDelta::milliseconds((1e3 * seconds) as i64));
        let progress = self.progress.as_ref().map(|progress| ProgressView {
            completed: progress.completed,
            total: progress.total,
            unit: &progress.unit,
            fraction: progress.fraction(),
            rate_per_second: progress.rate_per_second,
            eta_seconds: eta,
        });
        let url = |rest: &str| format!("/api/v1/jobs/{}{rest}", self.id);
        JobView {
            id: Some(&self.id),
            object: "job",
            kind: self.kind,
            status: self.status,
            phase: self.phase.as_deref(),
            progress,
            created_at: self.created_at,
            started_at: self.started_at,
            finished_at: self.finished_at,
            estimated_finish_at: milliseconds
                .and_then(|left| self.updated_at.checked_add_signed(left)),
            updated_at: self.updated_at,
            params: &self.params,
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

    /// As it would be: it has no id, and nothing can be asked of it.
    pub(crate) fn draft(&self, estimate: Estimate) -> JobView<'_> {
        JobView { id: None, urls: None, estimate: Some(estimate), ..self.view() }
    }
}

impl Progress {
    /// The share of the phase that is done.
    fn fraction(&self) -> f64 {
        if self.total > 0.0 { self.completed / self.total } else { 0.0 }
    }
}
