//! The verdict of an attempt, and its reasons in words.

use geometry::Vec3;
use scene::Loss;

/// How an attempt ended.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", tag = "outcome")]
pub enum Verdict {
    /// Held for the whole time; greatest slip in the palm (m).
    Lifted {
        /// Greatest slip (m).
        slip: f32,
    },
    /// Not held.
    Failed {
        /// Why.
        reason: Failure,
    },
}

/// Why an attempt failed.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// No point of the object is in the cloud.
    Unseen,
    /// No start configuration, or no motion to it.
    Unreachable,
    /// The object moved before arm or hand had touched it: it fell over, or somebody pulled at it.
    Shifted,
    /// The arm moved the object on its way.
    Collided,
    /// The hand closed beside the object.
    Missed,
    /// The hand moved the object away.
    PushedAway,
    /// The object slid or turned in the hand.
    Slipped,
    /// The object was raised, but not clear of the table or of the arm.
    Low,
    /// The object was lifted and lost.
    Dropped,
    /// The simulation or the policy left the finite numbers.
    NotFinite,
}

impl Verdict {
    /// Whether the object was lifted.
    pub fn is_lifted(&self) -> bool {
        matches!(self, Self::Lifted { .. })
    }

    /// The verdict for people.
    pub fn words(&self) -> &'static str {
        match self {
            Self::Lifted { .. } => "Lifted and held.",
            Self::Failed { reason } => reason.words(),
        }
    }
}

impl Failure {
    /// The reason for people.
    pub fn words(&self) -> &'static str {
        match self {
            Self::Unseen => "Not seen: no point of the object is in the camera's cloud.",
            Self::Unreachable => "Out of reach: no start configuration near the object.",
            Self::Shifted => "Shifted: the object moved before the arm had touched it.",
            Self::Collided => "Collided: the arm moved the object on its way.",
            Self::Missed => "Missed: the hand closed beside the object.",
            Self::PushedAway => "Pushed away: the hand moved the object instead of holding it.",
            Self::Slipped => "Slipped: the object slid or turned in the hand.",
            Self::Low => "Too low: the object was raised, but not clear of table and arm.",
            Self::Dropped => "Dropped: the object was lifted and lost.",
            Self::NotFinite => "The motion left the finite numbers.",
        }
    }
}

/// What the object did, for telling failures apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Story {
    /// Where the object stood.
    pub(crate) start: Vec3,
    /// Its greatest height over the table so far (m).
    pub(crate) highest: f32,
    /// Whether arm or hand touched it on the way to where the controller begins.
    pub(crate) is_touched: bool,
}

/// Height (m) from which an object counts as having been lifted.
const RAISED: f32 = 0.03;
/// Distance (m) from which a standing object counts as pushed.
const PUSHED: f32 = 0.05;

impl Story {
    /// The reason for a failure that shows when the object ends at `end`, held or not as `loss` says.
    pub(crate) fn reason(&self, end: Vec3, loss: Loss) -> Failure {
        let moved = (end - self.start).truncate().length();
        match loss {
            _ if self.highest <= RAISED && moved > PUSHED => Failure::PushedAway,
            _ if self.highest <= RAISED => Failure::Missed,
            _ if end.z - self.start.z <= RAISED => Failure::Dropped,
            // It has not come far yet.
            Loss::Free => Failure::Dropped,
            Loss::Slipped => Failure::Slipped,
            Loss::Low | Loss::Leaning => Failure::Low,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_follow_the_object() {
        let reason = |highest, x, z, loss| {
            Story { start: Vec3::ZERO, highest, is_touched: true }
                .reason(Vec3::new(x, 0.0, z), loss)
        };
        assert_eq!(reason(0.0, 0.01, 0.0, Loss::Low), Failure::Missed);
        assert_eq!(reason(0.0, 0.09, 0.0, Loss::Low), Failure::PushedAway);
        assert_eq!(reason(0.1, 0.0, 0.0, Loss::Slipped), Failure::Dropped);
        assert_eq!(reason(0.1, 0.0, 0.1, Loss::Slipped), Failure::Slipped);
        assert_eq!(reason(0.1, 0.0, 0.08, Loss::Low), Failure::Low);
        assert_eq!(reason(0.2, 0.0, 0.2, Loss::Leaning), Failure::Low);
        assert_eq!(reason(0.2, 0.0, 0.195, Loss::Free), Failure::Dropped);
    }
}
