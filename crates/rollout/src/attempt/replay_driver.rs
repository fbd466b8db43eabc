//! Replay of a recorded attempt, state by state, without its controller.

use crate::attempt::attempt_state::AttemptState;
use crate::attempt::driver::PlannedStates;
use crate::attempt::phase_clock::PhaseStarts;
use crate::attempt::{Outcome, Phase};
use crate::rollout_context::RolloutContext;
use robot::JointState;
use scene::HoldFailure;

/// The states, phase starts and outcome of a recorded attempt.
pub(crate) struct RecordedTrajectory {
    /// Commanded states: the initial state and one per tick.
    pub(crate) states: Vec<JointState>,
    pub(crate) phase_starts: PhaseStarts,
    /// Recorded outcome, if any.
    pub(crate) outcome: Option<Outcome>,
}

/// Position in a recorded attempt.
pub(crate) struct ReplayDriver {
    states: PlannedStates,
    phase_starts: PhaseStarts,
    approach_ticks: usize,
    outcome: Option<Outcome>,
}

impl ReplayDriver {
    /// Starts before the first recorded step. A recording without steps ends at once.
    pub(crate) fn new(recording: RecordedTrajectory, state: &mut AttemptState) -> Self {
        let RecordedTrajectory { states, phase_starts, outcome } = recording;
        let states: Vec<JointState> = states.into_iter().skip(1).collect();
        let approach_ticks = phase_starts.policy.unwrap_or(states.len());
        let states = PlannedStates::new(states);
        let driver = Self { states, phase_starts, approach_ticks, outcome };
        driver.end_recording(state);
        driver
    }

    /// The next recorded state. After the last one, the robot holds its position.
    pub(crate) fn next_state(&mut self, state: &AttemptState) -> JointState {
        self.states.next().unwrap_or_else(|| state.rest_state())
    }

    /// Starts the phases at their recorded ticks. The replay evaluates the hold itself.
    pub(crate) fn update_phase(&mut self, state: &mut AttemptState, context: &RolloutContext) {
        let has_reached = |start: Option<usize>| start.is_some_and(|tick| state.ticks() >= tick);
        match state.phase() {
            Phase::Approach | Phase::Policy if has_reached(self.phase_starts.lift) => {
                state.enter_lift();
            }
            Phase::Approach if has_reached(self.phase_starts.policy) => state.enter(Phase::Policy),
            Phase::Lift if self.phase_starts.hold == Some(state.ticks()) => {
                state.enter(Phase::Hold);
            }
            Phase::Hold => state.check_hold(&context.robot.config.protocol),
            Phase::Approach | Phase::Policy | Phase::Lift | Phase::Done => {}
        }
        self.end_recording(state);
    }

    /// Ends a replay without a hold after its last state, with the recorded failure.
    fn end_recording(&self, state: &mut AttemptState) {
        let is_over = self.states.is_finished() && state.outcome().is_none();
        if !is_over || state.phase_starts().hold.is_some() {
            return;
        }
        match self.outcome {
            Some(Outcome::Failed { reason }) => state.fail(reason),
            // A truncated recording does not show the hold.
            Some(Outcome::Lifted { .. }) => state.fail_hold(HoldFailure::TooLow),
            None => {}
        }
    }

    /// Tick at which the policy started, or the length of a recording without a policy phase.
    pub(crate) fn approach_ticks(&self) -> usize {
        self.approach_ticks
    }
}
