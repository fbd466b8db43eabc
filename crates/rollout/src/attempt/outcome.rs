//! Outcome of an attempt and reasons of failure.

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
        /// Max displacement (m) of the object in the palm frame, since the start of the lift.
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
    /// The object moved by more than 1 cm before contact with arm or hand: it fell over, or the user dragged
    /// it.
    Disturbed,
    /// The arm moved the object during the approach.
    Collided,
    /// The hand closed without a secure grasp: the object was never raised by more than 3 cm.
    Missed,
    /// The hand pushed the object away by more than 5 cm, without raising it.
    PushedAway,
    /// The object slid or rotated in the hand beyond the limits of the scene file (3 cm, 30 degrees).
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
