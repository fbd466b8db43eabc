//! Phases of an attempt: the protocol of the paper's §IV, with all its transitions.

use crate::attempt::FailureReason;
use crate::attempt::approach::scripted_closing;
use crate::attempt::attempt_state::AttemptState;
use crate::attempt::controller::Motion;
use crate::attempt::driver::PlannedStates;
use crate::attempt::live_driver::LiveDriver;
use crate::rollout_context::RolloutContext;
use grasps::plan::lift;
use scene::config::{AttemptProtocol, CONTROL_DT};

/// Phase of an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Spline from home to the start configuration.
    Approach,
    /// Motion of the controller, until the joints rest or the time is over.
    Policy,
    /// Lift by the planner's geometric fabric; the commanded finger joints stay fixed.
    Lift,
    /// Hold at the lift height.
    Hold,
    /// The attempt has an outcome.
    Done,
}

impl LiveDriver {
    /// Updates phase and outcome from the simulation state after a step.
    pub(crate) fn update_phase(&mut self, state: &mut AttemptState, context: &RolloutContext) {
        let protocol = &context.robot.config.protocol;
        match state.phase() {
            // §III-F, §IV: a quintic spline leads to the start configuration. The object must not move.
            Phase::Approach => {
                let failure = state.approach_failure();
                if let Some(reason) = failure.filter(|_| !self.controller.is_object_aware) {
                    state.fail(reason);
                } else if self.is_at_start(state) {
                    state.enter(Phase::Policy);
                    self.plan_scripted_closing(state, context);
                }
            }
            // §III-E, Eq. 6, 7: the policy moves the joints until they rest, or for the time of the protocol.
            Phase::Policy => {
                self.count_rest(state, protocol);
                if self.has_rested(protocol) || self.is_time_over(state, protocol) {
                    state.enter_lift();
                    self.plan_lift(state, context);
                }
            }
            // §IV: the planner's fabric raises the palm; the finger joints stay fixed.
            Phase::Lift => {
                if self.planned.is_finished() {
                    state.enter(Phase::Hold);
                }
            }
            // §IV: a success is an object that is held at the lift height.
            Phase::Hold => state.check_hold(protocol),
            Phase::Done => {}
        }
    }

    /// Whether the approach ends here. The states of a planned motion follow it without a gap.
    fn is_at_start(&self, state: &AttemptState) -> bool {
        match self.controller.motion {
            Motion::Planned => state.ticks_in_phase() >= self.approach_ticks,
            Motion::Network | Motion::ScriptedClosing => self.planned.is_finished(),
        }
    }

    fn plan_scripted_closing(&mut self, state: &AttemptState, context: &RolloutContext) {
        if self.controller.motion == Motion::ScriptedClosing {
            self.planned = PlannedStates::new(scripted_closing(&state.commanded().q, context));
        }
    }

    /// Counts consecutive control periods below the rest speed. Planned motions rest only at their end.
    fn count_rest(&mut self, state: &AttemptState, protocol: &AttemptProtocol) {
        let is_slow = state.commanded().qd.norm() < protocol.rest_speed;
        let is_at_rest = is_slow && self.planned.is_finished();
        self.resting_ticks = if is_at_rest { self.resting_ticks + 1 } else { 0 };
    }

    fn has_rested(&self, protocol: &AttemptProtocol) -> bool {
        self.resting_ticks as f64 * CONTROL_DT >= protocol.rest_seconds
    }

    /// Whether the time of the policy is over. Planned motions are executed to their end.
    fn is_time_over(&self, state: &AttemptState, protocol: &AttemptProtocol) -> bool {
        let elapsed = state.ticks_in_phase() as f64 * CONTROL_DT;
        elapsed >= protocol.policy_seconds && self.planned.is_finished()
    }

    /// Plans the lift from the commanded position; its first state is that position.
    fn plan_lift(&mut self, state: &mut AttemptState, context: &RolloutContext) {
        let robot = &context.robot;
        match lift::plan(&robot.config, &robot.tree, &state.rest_state()) {
            Ok(Some(states)) => {
                self.planned = PlannedStates::new(states);
                self.planned.next();
            }
            _ => state.fail(FailureReason::NotFinite),
        }
    }
}
