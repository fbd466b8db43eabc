//! A file that plays: a demonstration of a dataset, or a recorded attempt.

use crate::attempt::Attempt;
use crate::demonstration::Demonstration;
use crate::episode::Episode;
use crate::workcell::{RolloutError, Workcell};
use geometry::object::Object;
use serde::de::IgnoredAny;

/// A file that plays (JSON).
#[derive(Clone, Debug, PartialEq)]
pub enum Tape {
    /// Joint states that were planned.
    Demonstration(Demonstration),
    /// Joint targets that were recorded.
    Episode(Episode),
}

/// What tells the one from the other.
#[derive(serde::Deserialize)]
struct Kind {
    targets: Option<IgnoredAny>,
}

impl Tape {
    /// Reads one or the other.
    pub fn read(bytes: &[u8]) -> serde_json::Result<Self> {
        let Kind { targets } = serde_json::from_slice(bytes)?;
        match targets {
            None => Ok(Self::Demonstration(serde_json::from_slice(bytes)?)),
            Some(_) => Ok(Self::Episode(serde_json::from_slice(bytes)?)),
        }
    }

    /// Hash and name of its object, and where that stands: x, y (m), yaw (rad).
    pub fn object(&self) -> (&str, &str, [f32; 3]) {
        match self {
            Self::Demonstration(file) => (&file.object, &file.name, file.pose),
            Self::Episode(file) => (&file.object, &file.name, file.pose),
        }
    }

    /// Begins to play it.
    pub fn begin(&self, workcell: &Workcell, object: &Object) -> Result<Attempt, RolloutError> {
        match self {
            Self::Demonstration(file) => file.begin(workcell, object),
            Self::Episode(file) => file.begin(workcell, object),
        }
    }
}
