//! Outcome of an attempt and reasons of failure.

use geometry::Vec3;
use scene::HoldFailure;

/// Outcome of an attempt.
///
/// ```rust
/// use rollout::{FailureReason, Outcome};
/// let outcome = Outcome::Failed { reason: FailureReason::PushedAway };
/// assert!(!outcome.is_lifted());
/// let json = serde_json::json!({ "result": "failed", "reason": "pushed_away" });
/// assert_eq!(serde_json::to_value(outcome)?, json);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", tag = "result")]
pub enum Outcome {
    /// The object was lifted and held.
    Lifted {
        /// Max displacement (m) of the object in the palm.
        slip: f32,
    },
    /// The object was not lifted or not held.
    Failed {
        /// Reason of the failure.
        reason: FailureReason,
    },
}

/// Reason of a failed attempt.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum FailureReason {
    /// No point of the object is in the point cloud.
    NotVisible,
    /// No start configuration exists, or no feasible motion to it.
    Unreachable,
    /// The object moved before contact with arm or hand: it fell over, or the user dragged it.
    Disturbed,
    /// The arm moved the object during the approach.
    Collided,
    /// The hand closed without a secure grasp.
    Missed,
    /// The hand pushed the object away.
    PushedAway,
    /// The object slid or rotated in the hand.
    Slipped,
    /// The object was raised, but not clear of the table or of the arm.
    TooLow,
    /// The object was lifted and then lost.
    Dropped,
    /// Simulation or policy produced non-finite values.
    NotFinite,
}

impl Outcome {
    /// Whether the object was lifted and held.
    pub fn is_lifted(&self) -> bool {
        matches!(self, Self::Lifted { .. })
    }

    /// Description of the outcome, for display.
    pub fn description(&self) -> &'static str {
        match self {
            Self::Lifted { .. } => "Lifted and held.",
            Self::Failed { reason } => reason.description(),
        }
    }
}

impl FailureReason {
    /// Description of the reason, for display.
    pub fn description(&self) -> &'static str {
        match self {
            Self::NotVisible => {
                "Not visible: no point of the object is in the camera's point cloud."
            }
            Self::Unreachable => "Out of reach: no start configuration near the object.",
            Self::Disturbed => "Disturbed: the object moved before the arm touched it.",
            Self::Collided => "Collided: the arm moved the object during the approach.",
            Self::Missed => "Missed: no secure grasp.",
            Self::PushedAway => "Pushed away: the hand moved the object instead of grasping it.",
            Self::Slipped => "Slipped: the object slid or rotated in the hand.",
            Self::TooLow => "Too low: the object was not lifted clear of table and arm.",
            Self::Dropped => "Dropped: the object was lifted and then lost.",
            Self::NotFinite => "Simulation diverged.",
        }
    }
}

/// Object motion and contact so far, which determine the reason of a failure.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactHistory {
    /// Initial position of the object (m).
    pub(crate) start_position: Vec3,
    /// Max height (m) above the table so far.
    pub(crate) max_height: f32,
    /// Whether arm or hand touched the object during the approach.
    pub(crate) was_touched: bool,
}

/// Height (m) above which an object counts as lifted.
const MIN_LIFTED_HEIGHT: f32 = 0.03;
/// Displacement (m) above which an object on the table counts as pushed.
const MIN_PUSH_DISTANCE: f32 = 0.05;

impl ContactHistory {
    /// Reason of a failure, from the final object position `end` (m) and the failed hold criterion.
    pub(crate) fn failure_reason(&self, end: Vec3, failure: HoldFailure) -> FailureReason {
        let displacement = (end - self.start_position).truncate().length();
        match failure {
            _ if self.max_height <= MIN_LIFTED_HEIGHT && displacement > MIN_PUSH_DISTANCE => {
                FailureReason::PushedAway
            }
            _ if self.max_height <= MIN_LIFTED_HEIGHT => FailureReason::Missed,
            _ if end.z - self.start_position.z <= MIN_LIFTED_HEIGHT => FailureReason::Dropped,
            // The object has just been lost and is still near the hand.
            HoldFailure::NoContact => FailureReason::Dropped,
            HoldFailure::Slipped => FailureReason::Slipped,
            HoldFailure::TooLow | HoldFailure::ForeignContact => FailureReason::TooLow,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failure_reason_follows_object_motion() {
        let reason = |highest, x, z, failure| {
            ContactHistory { start_position: Vec3::ZERO, max_height: highest, was_touched: true }
                .failure_reason(Vec3::new(x, 0.0, z), failure)
        };
        assert_eq!(reason(0.0, 0.01, 0.0, HoldFailure::TooLow), FailureReason::Missed);
        assert_eq!(reason(0.0, 0.09, 0.0, HoldFailure::TooLow), FailureReason::PushedAway);
        assert_eq!(reason(0.1, 0.0, 0.0, HoldFailure::Slipped), FailureReason::Dropped);
        assert_eq!(reason(0.1, 0.0, 0.1, HoldFailure::Slipped), FailureReason::Slipped);
        assert_eq!(reason(0.1, 0.0, 0.08, HoldFailure::TooLow), FailureReason::TooLow);
        assert_eq!(reason(0.2, 0.0, 0.2, HoldFailure::ForeignContact), FailureReason::TooLow);
        assert_eq!(reason(0.2, 0.0, 0.195, HoldFailure::NoContact), FailureReason::Dropped);
    }
}
