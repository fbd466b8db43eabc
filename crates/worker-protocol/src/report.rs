//! Reports of a worker and the replies of the server.

use crate::{Progress, Worker};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

/// Report of a worker. All members are optional; an empty report only renews the lease.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WorkerReport {
    /// Sequence number of the report, from 1; a repeated report is applied once. 0: not numbered, always
    /// applied.
    pub seq: u64,
    /// Identity of the worker; sent once.
    pub worker: Option<Worker>,
    /// Current phase, if it changed.
    pub phase: Option<String>,
    /// Progress of the phase.
    pub progress: Option<Progress>,
    /// Events since the last report, oldest first.
    pub events: Vec<WorkerEvent>,
    /// Set in the last report of a worker.
    pub completion: Option<Completion>,
}

/// Event reported by a worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum WorkerEvent {
    /// Log message.
    Log(String),
    /// Log message at warning level.
    Warning(String),
    /// Metrics of a training step.
    Metric(MetricValues),
    /// A checkpoint was written; it can be used as a model.
    Checkpoint(WrittenCheckpoint),
}

// The contents of the variants are named schemas: generators of clients fail on nested anonymous ones.

/// Metrics by name; `step` is the training step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MetricValues(pub Map<String, Value>);

/// A checkpoint that a training wrote.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WrittenCheckpoint {
    /// Training step.
    pub step: u64,
}

/// Result of a worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Completion {
    /// All work is finished.
    Succeeded,
    /// The job failed, with this error message.
    Failed(String),
}

/// Instruction of the server to a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Directive {
    /// Continue to work.
    Continue,
    /// Exit immediately; files on disk are complete.
    Stop,
}

/// Reply to a report.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct ReportReply {
    /// Instruction to the worker.
    pub directive: Directive,
}
