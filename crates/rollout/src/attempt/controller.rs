//! Controllers of an attempt, with one table of their properties.
//!
//! A new controller is a variant, its row in `Controller::properties`, and its motion in
//! `Controller::plan`. The compiler asks for all three; other files read the properties only.

use crate::attempt::approach::{Approach, ApproachInputs, LatentInput};
use crate::attempt::{DemonstrationLibrary, FailureReason};
use crate::rollout_context::RolloutError;
use grasps::set::grasp::Grasp;
use rand_chacha::ChaCha8Rng;
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
    /// The learned policy. It integrates its own commanded state; the motors follow.
    Policy,
    /// The learned policy on measured joint states: the time step (Eq. 6, 7) starts from the measured state.
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
}

/// Motion between start configuration and lift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    /// Steps of the network, from the observation (Eq. 3-7).
    Network,
    /// The fingers close at a fixed palm.
    ScriptedClosing,
    /// States that are planned before the attempt, including the approach.
    Planned,
}

/// Joint state from which Eq. 6 and 7 integrate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feedback {
    /// The commanded state of the previous step.
    Commanded,
    /// The simulated joint state.
    Measured,
}

/// Properties of a controller, on which planning and phases depend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ControllerProperties {
    pub(crate) motion: Motion,
    pub(crate) latent: LatentInput,
    pub(crate) feedback: Feedback,
    /// Whether the motion is planned for this object and pose, and its approach avoids contact with the
    /// object. Otherwise the attempt fails if the object moves during the approach.
    pub(crate) is_object_aware: bool,
}

/// The learned policy.
const POLICY: ControllerProperties = ControllerProperties {
    motion: Motion::Network,
    latent: LatentInput::Observed,
    feedback: Feedback::Commanded,
    is_object_aware: false,
};

/// A motion that is planned for this object.
const PLANNED: ControllerProperties =
    ControllerProperties { motion: Motion::Planned, is_object_aware: true, ..POLICY };

impl Controller {
    /// The table of properties.
    pub(crate) fn properties(&self) -> ControllerProperties {
        type Row = ControllerProperties;
        match self {
            Self::Policy => POLICY,
            Self::PolicyMeasured => Row { feedback: Feedback::Measured, ..POLICY },
            Self::ShuffledLatent => Row { latent: LatentInput::Shuffled, ..POLICY },
            Self::ZeroLatent => Row { latent: LatentInput::Zero, ..POLICY },
            Self::ScriptedClose => Row { motion: Motion::ScriptedClosing, ..POLICY },
            Self::Planner | Self::PlannedGrasps(_) | Self::Demonstration(_) => PLANNED,
            Self::Playback(_) => Row { is_object_aware: false, ..PLANNED },
        }
    }

    /// Plans the approach, and the motion after it where it is planned. Returns the reason of a failure.
    pub(crate) fn plan(
        &self,
        inputs: &ApproachInputs,
        rng: &mut ChaCha8Rng,
    ) -> Result<Result<Approach, FailureReason>, RolloutError> {
        match self {
            Self::Policy
            | Self::PolicyMeasured
            | Self::ShuffledLatent
            | Self::ZeroLatent
            | Self::ScriptedClose => inputs.plan_for_policy(self.properties().latent, rng),
            Self::Planner => inputs.plan_catalog_grasps(rng),
            Self::PlannedGrasps(grasps) => inputs.plan_demonstration(grasps, rng),
            Self::Demonstration(states) if states.is_empty() => Err(RolloutError::NoStates),
            Self::Demonstration(states) => Ok(Ok(inputs.prepend_approach(states))),
            Self::Playback(library) => inputs.plan_playback(library),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn properties_follow_the_controller() {
        let row = |controller: Controller| controller.properties();
        let playback = Controller::Playback(Arc::default());
        let grasps = Controller::PlannedGrasps(Arc::default());
        let demonstration = Controller::Demonstration(Vec::new());

        let networks = [
            Controller::Policy,
            Controller::PolicyMeasured,
            Controller::ShuffledLatent,
            Controller::ZeroLatent,
        ];
        for controller in networks {
            assert_eq!(row(controller).motion, Motion::Network);
        }
        assert_eq!(row(Controller::ScriptedClose).motion, Motion::ScriptedClosing);
        for controller in [Controller::Planner, grasps, demonstration] {
            assert_eq!(row(controller), PLANNED);
        }
        // A playback is planned for another object pose.
        let playback = row(playback);
        assert!(playback.motion == Motion::Planned && !playback.is_object_aware);
        assert!(!row(Controller::ScriptedClose).is_object_aware);
    }
}
