//! A job as it is kept and shown.

use super::{Kind, Params, Status, Wish};
use chrono::{DateTime, Utc};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// All that is known of a job.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Job {
    /// `job_` and a number that sorts by time.
    pub(crate) id: String,
    /// What it does.
    pub(crate) kind: Kind,
    /// Where it stands.
    pub(crate) status: Status,
    /// What it is at, in the words of its program.
    pub(crate) phase: Option<String>,
    /// How far it is.
    pub(crate) progress: Option<Progress>,
    /// When it was asked for.
    pub(crate) created_at: DateTime<Utc>,
    /// When a process first began with it.
    pub(crate) started_at: Option<DateTime<Utc>>,
    /// When it ended.
    pub(crate) finished_at: Option<DateTime<Utc>>,
    /// When it last changed.
    pub(crate) updated_at: DateTime<Utc>,
    /// What it was told, with everything filled in.
    pub(crate) params: Params,
    /// A name for people.
    pub(crate) name: Option<String>,
    /// Whatever whoever asked for it wants to remember.
    pub(crate) metadata: Map<String, Value>,
    /// Higher ones begin first.
    pub(crate) priority: i64,
    /// What it works on.
    pub(crate) inputs: Inputs,
    /// What came of it.
    pub(crate) outputs: Outputs,
    /// The last metrics.
    pub(crate) latest_metrics: Map<String, Value>,
    /// Models that it wrote on its way.
    pub(crate) checkpoint_count: u64,
    /// Steps of the last one of them.
    #[serde(default)]
    pub(crate) checkpoint_step: u64,
    /// Why it failed.
    pub(crate) error: Option<Failure>,
    /// Who works on it.
    pub(crate) worker: Option<Worker>,
    /// How often a process began with it: what an earlier one says no longer counts.
    pub(crate) attempt: u64,
    /// Processes in a row that vanished without having come further than those before.
    pub(crate) lost: u64,
    /// How far any process came in each phase.
    #[serde(default)]
    pub(crate) furthest: BTreeMap<String, f64>,
    /// Number of the last report of this attempt that was heard.
    #[serde(default)]
    pub(crate) heard: u64,
    /// What is wished of its process.
    #[serde(default)]
    pub(crate) wish: Wish,
    /// Counts its changes.
    pub(crate) revision: u64,
}

/// How far a job is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Progress {
    /// Done.
    pub completed: f64,
    /// To do in this phase.
    pub total: f64,
    /// What is counted.
    pub unit: String,
    /// Done a second.
    pub rate_per_second: Option<f64>,
}

/// What a job works on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct Inputs {
    /// Of a training.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) dataset_id: Option<String>,
    /// Of a policy.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) encoder_id: Option<String>,
    /// Of an evaluation.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) model_id: Option<String>,
    /// Of whatever is about an object that was uploaded.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) mesh_id: Option<String>,
}

/// What came of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct Outputs {
    /// The dataset that was made.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) dataset_id: Option<String>,
    /// The encoder or policy that was trained.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) model_id: Option<String>,
    /// Files by their hash.
    #[serde(default)]
    pub(crate) artifact_ids: Vec<String>,
}

/// Why a job failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct Failure {
    /// For programs.
    pub(crate) code: String,
    /// For people.
    pub(crate) message: String,
    /// Which parameter, if it was one.
    pub(crate) param: Option<String>,
    /// What to do about it.
    pub(crate) hint: Option<String>,
}

/// Who works on a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Worker {
    /// Its machine.
    pub host: String,
    /// Its process there.
    pub pid: u32,
    /// Version of its program.
    pub version: String,
    /// Threads that its machine has for it.
    #[serde(default)]
    pub threads: usize,
}

impl Job {
    /// Whether it goes on from where it was when it is resumed or tried again.
    pub(crate) fn is_resumable(&self) -> bool {
        match self.status {
            Status::Paused => true,
            Status::Failed | Status::Cancelled => self.attempt > 0,
            _ => false,
        }
    }
}

impl Progress {
    /// How long the phase takes yet, if that can be said.
    pub(super) fn seconds_left(&self) -> Option<f64> {
        let rate = self.rate_per_second.filter(|rate| *rate > 0.0)?;
        Some((self.total - self.completed).max(0.0) / rate)
    }
}
