//! Who acts in an attempt.

use crate::episode::Recording;
use crate::library::Library;
use grasps::grasp::Grasp;
use robot::JointState;
use std::sync::Arc;

/// Who moves the joints between start and lift.
#[derive(Clone, Debug)]
pub enum Controller {
    /// The learned policy, which integrates its own commanded state.
    Policy,
    /// The learned policy told the joints as they are measured: Eq. 6 and 7 lead on from there.
    Measured,
    /// The learned policy with z of another object pose (`shuffled z` in the suite).
    ShuffledLatent,
    /// The learned policy with z = 0 (`zero z` in the suite).
    ZeroLatent,
    /// Fingers closed by script at the start configuration (`no policy` in the suite).
    Script,
    /// A demonstration planned for this pose, with knowledge of the object.
    Planner,
    /// The same with these grasps.
    Found(Arc<Vec<Grasp>>),
    /// A demonstration that was made for this pose.
    Demonstration(Vec<JointState>),
    /// The demonstration that begins where the policy would: play-back without a network (`play-back` in the suite).
    Nearest(Arc<Library>),
    /// A recorded attempt, row by row.
    Replay(Recording),
}

impl Controller {
    /// Whether a network acts.
    pub(crate) fn is_of_model(&self) -> bool {
        matches!(self, Self::Policy | Self::Measured | Self::ShuffledLatent | Self::ZeroLatent)
    }

    /// Whether the motion was planned before the attempt, its way to where it begins included.
    pub(crate) fn is_planned(&self) -> bool {
        matches!(self, Self::Planner | Self::Found(_) | Self::Demonstration(_) | Self::Nearest(_))
    }

    /// Whether it was planned for this very object and pose, and its way kept off them.
    pub(crate) fn knows_the_place(&self) -> bool {
        self.is_planned() && !matches!(self, Self::Nearest(_))
    }
}
