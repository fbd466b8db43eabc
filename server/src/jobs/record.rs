//! The stored record of a job.

use super::{DesiredState, Kind, Params, Status};
use chrono::{DateTime, Utc};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;
use worker_protocol::{Progress, Worker};

/// A job as stored in the database.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Job {
    /// `job_` and a number that sorts by time.
    pub(crate) id: String,
    /// Current status.
    pub(crate) status: Status,
    /// Current phase, as named by the worker.
    pub(crate) phase: Option<String>,
    /// Progress of the current phase.
    pub(crate) progress: Option<Progress>,
    /// Time of the request (UTC).
    pub(crate) created_at: DateTime<Utc>,
    /// Start of the first worker (UTC).
    pub(crate) started_at: Option<DateTime<Utc>>,
    /// Time of the last transition to a terminal status (UTC).
    pub(crate) finished_at: Option<DateTime<Utc>>,
    /// Time of the last change visible to clients (UTC).
    pub(crate) updated_at: DateTime<Utc>,
    /// Kind and parameters, with defaults filled in.
    #[serde(flatten)]
    pub(crate) params: Params,
    /// Display name.
    pub(crate) name: Option<String>,
    /// Key-value pairs of the client.
    pub(crate) metadata: Map<String, Value>,
    /// Jobs with a higher priority start first.
    pub(crate) priority: i64,
    /// Ids of the datasets, models and meshes that it uses.
    pub(crate) inputs: Inputs,
    /// Ids of the dataset, model and artifacts that it produced.
    pub(crate) outputs: Outputs,
    /// Latest value of each metric.
    pub(crate) latest_metrics: Map<String, Value>,
    /// Number of checkpoints stored so far.
    pub(crate) checkpoint_count: u64,
    /// Training step of the last stored checkpoint.
    #[serde(default)]
    pub(crate) checkpoint_step: u64,
    /// Error of a failed job.
    pub(crate) error: Option<JobError>,
    /// Worker that runs or last ran the job.
    pub(crate) worker: Option<Worker>,
    /// Number of workers started so far. Reports of earlier workers are rejected.
    pub(crate) attempt: u64,
    /// Workers lost in a row without new progress.
    pub(crate) consecutive_lost_workers: u64,
    /// Highest progress of any worker, by phase.
    #[serde(default)]
    pub(crate) best_progress: BTreeMap<String, f64>,
    /// Sequence number of the last report applied in this attempt.
    #[serde(default)]
    pub(crate) last_report_seq: u64,
    /// Desired state of the worker.
    #[serde(default)]
    pub(crate) desired_state: DesiredState,
    /// Number of changes visible to clients; used as ETag.
    pub(crate) revision: u64,
}

/// Inputs of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct Inputs {
    /// Dataset of a training job.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) dataset_id: Option<String>,
    /// Encoder of a policy training.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) encoder_id: Option<String>,
    /// Model of an evaluation.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) model_id: Option<String>,
    /// Uploaded mesh, if the job uses one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) mesh_id: Option<String>,
}

/// Outputs of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct Outputs {
    /// Generated dataset.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) dataset_id: Option<String>,
    /// Trained encoder or policy.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) model_id: Option<String>,
    /// BLAKE3 hashes (hex) of the stored files.
    #[serde(default)]
    pub(crate) artifact_ids: Vec<String>,
}

/// Error of a failed job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct JobError {
    /// Stable machine-readable code.
    pub(crate) code: String,
    /// Cause, as text.
    pub(crate) message: String,
    /// Invalid parameter, if one caused the error.
    pub(crate) param: Option<String>,
    /// Suggested remedy.
    pub(crate) hint: Option<String>,
}

impl Job {
    /// Kind of work.
    pub(crate) fn kind(&self) -> Kind {
        self.params.kind()
    }

    /// Whether a resume or retry continues from stored progress.
    pub(crate) fn is_resumable(&self) -> bool {
        match self.status {
            Status::Paused => true,
            Status::Failed | Status::Cancelled => self.attempt > 0,
            _ => false,
        }
    }
}
