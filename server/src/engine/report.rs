//! What the process of a job says, and what it is answered.

use crate::job::{Progress, Worker};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

/// What a process needs to know, in the file that [`super::JOB_FILE`] names.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct JobFile {
    /// Where to send reports.
    pub url: String,
    /// With what to prove itself: good for this attempt alone.
    pub token: String,
    /// File that it locks while it works: of two processes in one folder the second one waits.
    pub lock: std::path::PathBuf,
}

/// A report: all of it may be missing, then it only says that the process is there.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Report {
    /// Which report of this process it is, from 1: one that is sent again is heard once. 0 has no number.
    pub number: u64,
    /// Who reports.
    pub worker: Option<Worker>,
    /// What it is at.
    pub phase: Option<String>,
    /// How far it is with that.
    pub progress: Option<Progress>,
    /// What happened since the last report, oldest first.
    pub notes: Vec<Note>,
    /// That it is over.
    pub ended: Option<Ended>,
}

/// Something that happened in a process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Note {
    /// It said something.
    Log(String),
    /// It warned.
    Warning(String),
    /// It measured something at a step.
    Metric(Map<String, Value>),
    /// It wrote a model that can be used, after so many steps.
    Checkpoint {
        /// Steps.
        step: u64,
    },
}

/// How a process ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// All is done.
    Done,
    /// It failed, and why.
    Failed(String),
}

/// What a process is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Go on.
    Go,
    /// End at once: what is on disk is good.
    Stop,
}

/// The answer to a report.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct Answer {
    /// What to do.
    pub command: Command,
}
