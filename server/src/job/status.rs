//! Where a job stands, and what is wished of it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Where a job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Status {
    /// Waits for a place.
    Queued,
    /// A process works on it.
    Running,
    /// Stopped, and goes on from its last checkpoint when it is resumed.
    Paused,
    /// Is being stopped for good.
    Cancelling,
    /// Done.
    Succeeded,
    /// Ended with an error.
    Failed,
    /// Stopped for good.
    Cancelled,
}

impl Status {
    /// All of them.
    pub(crate) const ALL: [Self; 7] = [
        Self::Queued,
        Self::Running,
        Self::Paused,
        Self::Cancelling,
        Self::Succeeded,
        Self::Failed,
        Self::Cancelled,
    ];

    /// As in JSON.
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

    /// The status of this name; "canceled" is understood, too.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let name = if name == "canceled" { "cancelled" } else { name };
        Self::ALL.into_iter().find(|status| status.name() == name)
    }

    /// Whether nothing comes after it but a retry.
    pub(crate) fn is_terminal(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }

    /// Whether a process may be at work.
    pub(crate) fn has_process(self) -> bool {
        matches!(self, Self::Running | Self::Cancelling)
    }
}

/// What is wished of a job whose process is at work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Wish {
    /// That it goes on.
    #[default]
    Run,
    /// That it stops and can be resumed.
    Pause,
    /// That it stops for good.
    Cancel,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_json() {
        for status in Status::ALL {
            assert_eq!(serde_json::to_value(status).unwrap(), status.name());
            assert_eq!(Status::named(status.name()), Some(status));
        }
        assert_eq!(Status::named("canceled"), Some(Status::Cancelled));
        assert_eq!(Status::named("done"), None);
    }
}
