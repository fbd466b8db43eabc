//! Status of a job and the desired state of its worker.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Status of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Status {
    /// Waits for a free slot.
    Queued,
    /// A worker runs.
    Running,
    /// Stopped; resumes from its last checkpoint on request.
    Paused,
    /// Cancellation requested; the worker has not exited yet.
    Cancelling,
    /// Finished; outputs are available.
    Succeeded,
    /// Finished with an error.
    Failed,
    /// Cancelled by a client.
    Cancelled,
}

impl Status {
    /// All statuses, in the order of a job's life.
    pub(crate) const ALL: [Self; 7] = [
        Self::Queued,
        Self::Running,
        Self::Paused,
        Self::Cancelling,
        Self::Succeeded,
        Self::Failed,
        Self::Cancelled,
    ];

    /// Name in JSON and in the database.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Cancelling => "cancelling",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Inverse of [`Status::name`]; also accepts the spelling "canceled".
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        let name = if name == "canceled" { "cancelled" } else { name };
        Self::ALL.into_iter().find(|status| status.name() == name)
    }

    /// Whether the job has finished; only a retry leaves this status.
    pub(crate) fn is_terminal(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }

    /// Whether a worker may be running.
    pub(crate) fn has_process(self) -> bool {
        matches!(self, Self::Running | Self::Cancelling)
    }
}

/// Desired state of a job that has a worker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum DesiredState {
    /// Continue to run.
    #[default]
    Run,
    /// Stop; the job can be resumed.
    Pause,
    /// Stop and cancel the job.
    Cancel,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_names_match_their_json() {
        for status in Status::ALL {
            assert_eq!(serde_json::to_value(status).unwrap(), status.name());
            assert_eq!(Status::from_name(status.name()), Some(status));
        }
        assert_eq!(Status::from_name("canceled"), Some(Status::Cancelled));
        assert_eq!(Status::from_name("done"), None);
    }
}
