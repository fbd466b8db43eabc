//! A file that can be replayed: a demonstration of a dataset or a recorded attempt.

use crate::attempt::Attempt;
use crate::recording::{AttemptRecording, DemonstrationFile};
use crate::rollout_context::{RolloutContext, RolloutError};
use objects::object::Object;
use serde::de::IgnoredAny;

/// Contents of a replay file (JSON).
#[derive(Clone, Debug, PartialEq)]
pub enum ReplayFile {
    /// A planned demonstration.
    Demonstration(DemonstrationFile),
    /// A recorded attempt.
    Recording(AttemptRecording),
}

/// The field that distinguishes the two file types.
#[derive(serde::Deserialize)]
struct FileProbe {
    targets: Option<IgnoredAny>,
}

impl ReplayFile {
    /// Parses a replay file of either type.
    pub fn parse(bytes: &[u8]) -> serde_json::Result<Self> {
        let FileProbe { targets } = serde_json::from_slice(bytes)?;
        match targets {
            None => Ok(Self::Demonstration(serde_json::from_slice(bytes)?)),
            Some(_) => Ok(Self::Recording(serde_json::from_slice(bytes)?)),
        }
    }

    /// Hash, name and pose of the object: x, y (m), yaw (rad).
    pub fn object(&self) -> (&str, &str, [f32; 3]) {
        match self {
            Self::Demonstration(file) => (&file.object_hash, &file.object_name, file.object_pose),
            Self::Recording(file) => (&file.object_hash, &file.object_name, file.object_pose),
        }
    }

    /// Starts the replay.
    pub fn start_replay(
        &self,
        context: &RolloutContext,
        object: &Object,
    ) -> Result<Attempt, RolloutError> {
        match self {
            Self::Demonstration(file) => file.start_replay(context, object),
            Self::Recording(file) => file.start_replay(context, object),
        }
    }
}
