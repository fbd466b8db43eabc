//! Controllers of an attempt.

use crate::demonstration_library::DemonstrationLibrary;
use crate::recording::RecordedTrajectory;
use grasps::set::grasp::Grasp;
use robot::JointState;
use std::sync::Arc;

/// Source of the joint commands between start configuration and lift.
///
/// ```rust
/// use rollout::{Attempt, Controller, RolloutContext, RolloutError};
/// let context = RolloutContext::new()?; // without a model
/// let object = objects::Object::from_catalog("sugar_box").expect("a built-in object");
/// let new = |controller| Attempt::new(&context, &object, "sugar_box", None, 0, controller);
/// assert!(matches!(new(Controller::Policy), Err(RolloutError::NoModel)));
/// # Ok::<(), RolloutError>(())
/// ```
#[derive(Clone, Debug)]
pub enum Controller {
    /// The learned policy. It integrates its own commanded state.
    Policy,
    /// The learned policy on measured joint states: Eq. 6 and 7 integrate from the measured state.
    PolicyMeasured,
    /// The learned policy with z of another object pose (`shuffled z` in the comparison).
    ShuffledLatent,
    /// The learned policy with z = 0 (`zero z` in the comparison).
    ZeroLatent,
    /// No policy: the fingers close at the start configuration (`no policy` in the comparison).
    ScriptedClose,
    /// A demonstration planned for this object pose, with full knowledge of the object.
    Planner,
    /// As [`Controller::Planner`], with the given grasps.
    PlannedGrasps(Arc<Vec<Grasp>>),
    /// A precomputed demonstration for this object pose.
    Demonstration(Vec<JointState>),
    /// The demonstration that starts nearest to the start configuration, without a network (`play-back`).
    Playback(Arc<DemonstrationLibrary>),
    /// A recorded attempt, replayed state by state.
    Replay(RecordedTrajectory),
}

impl Controller {
    /// Whether a network computes the commands.
    pub(crate) fn uses_network(&self) -> bool {
        matches!(
            self,
            Self::Policy | Self::PolicyMeasured | Self::ShuffledLatent | Self::ZeroLatent
        )
    }

    /// Whether the whole motion is planned before the attempt, including the approach.
    pub(crate) fn is_planned(&self) -> bool {
        matches!(
            self,
            Self::Planner | Self::PlannedGrasps(_) | Self::Demonstration(_) | Self::Playback(_)
        )
    }

    /// Whether the motion is planned for this object and pose, and its approach avoids contact with the
    /// object.
    pub(crate) fn is_object_aware(&self) -> bool {
        self.is_planned() && !matches!(self, Self::Playback(_))
    }
}
