//! The two drivers of an attempt: live, with a controller, or the replay of a recording.

use crate::attempt::FailureReason;
use crate::attempt::attempt_state::AttemptState;
use crate::attempt::live_driver::LiveDriver;
use crate::attempt::replay_driver::ReplayDriver;
use crate::rollout_context::RolloutContext;
use robot::{JointState, JointVector};

/// Source of commanded states and phase transitions.
pub(crate) enum Driver {
    /// A controller, with the phases of the protocol.
    Live(LiveDriver),
    /// A recorded attempt, with its recorded phases.
    Replay(ReplayDriver),
}

impl Driver {
    /// The next commanded state, or the reason why there is none. `qdd` is that of the network for
    /// [`LiveDriver::network_input`].
    pub(crate) fn next_state(
        &mut self,
        state: &AttemptState,
        context: &RolloutContext,
        qdd: Option<JointVector>,
    ) -> Result<JointState, FailureReason> {
        match self {
            Self::Live(driver) => driver.next_state(state, context, qdd),
            Self::Replay(driver) => Ok(driver.next_state(state)),
        }
    }

    /// Updates phase and outcome from the simulation state after a step.
    pub(crate) fn update_phase(&mut self, state: &mut AttemptState, context: &RolloutContext) {
        match self {
            Self::Live(driver) => driver.update_phase(state, context),
            Self::Replay(driver) => driver.update_phase(state, context),
        }
    }

    /// Tick at which the start configuration is reached, as planned or recorded.
    pub(crate) fn approach_ticks(&self) -> usize {
        match self {
            Self::Live(driver) => driver.approach_ticks(),
            Self::Replay(driver) => driver.approach_ticks(),
        }
    }

    /// The live driver; `None` in a replay.
    pub(crate) fn live(&self) -> Option<&LiveDriver> {
        match self {
            Self::Live(driver) => Some(driver),
            Self::Replay(_) => None,
        }
    }
}

/// Joint states that are executed one per control period.
pub(crate) struct PlannedStates(std::vec::IntoIter<JointState>);

impl PlannedStates {
    pub(crate) fn new(states: Vec<JointState>) -> Self {
        Self(states.into_iter())
    }

    /// Takes the next state; `None` at the end.
    pub(crate) fn next(&mut self) -> Option<JointState> {
        self.0.next()
    }

    /// Whether all states have been executed.
    pub(crate) fn is_finished(&self) -> bool {
        self.0.len() == 0
    }
}
