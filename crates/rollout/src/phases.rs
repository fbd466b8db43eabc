//! Phases of an attempt: their transitions and the outcome.

use crate::approach::scripted_closing;
use crate::attempt::Attempt;
use crate::controller::Controller;
use crate::outcome::{FailureReason, Outcome};
use crate::recording::RecordedTrajectory;
use crate::rollout_context::RolloutContext;
use grasps::plan::lift;
use robot::JointState;
use scene::config::CONTROL_DT;
use scene::{HoldFailure, HoldMonitor, Simulation};

/// Max displacement (m) of the object during the approach.
const MAX_APPROACH_SHIFT: f32 = 0.01;

/// Phase of an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Spline to the start configuration.
    Approach,
    /// Motion of the controller.
    Policy,
    /// Lift by the planner's fabric.
    Lift,
    /// Hold at the lift height.
    Hold,
    /// The attempt has an outcome.
    Done,
}

impl Attempt {
    /// Updates phase and outcome from the simulation state after a step.
    pub(crate) fn update_phase(&mut self, context: &RolloutContext) {
        let protocol = &context.robot.config.protocol;
        self.contact_history.max_height =
            self.contact_history.max_height.max(self.scene.object_height());
        if !self.scene.is_finite() {
            return self.fail(FailureReason::NotFinite);
        }
        let object = self.scene.object_pose().translation;
        match self.phase {
            Phase::Approach | Phase::Policy if self.is_replay() => self.replay_phases(context),
            Phase::Approach => {
                let touching = self.scene.contact_state();
                self.contact_history.was_touched |= touching.hand || touching.arm;
                let is_displaced =
                    object.distance(self.contact_history.start_position) > MAX_APPROACH_SHIFT;
                if is_displaced && !self.controller.is_object_aware() {
                    let is_touched = self.contact_history.was_touched;
                    return self.fail(if is_touched {
                        FailureReason::Collided
                    } else {
                        FailureReason::Disturbed
                    });
                }
                if self.controller.is_planned() {
                    if self.ticks_in_phase >= self.approach_ticks {
                        self.start_policy();
                    }
                } else if self.planned_states.len() == 0 {
                    self.start_policy();
                    if matches!(self.controller, Controller::ScriptedClose) {
                        self.planned_states =
                            scripted_closing(&self.commanded.q, context).into_iter();
                    }
                }
            }
            Phase::Policy => {
                let is_at_rest = self.commanded.qd.norm() < protocol.rest_speed
                    && self.planned_states.len() == 0;
                self.resting_ticks = if is_at_rest { self.resting_ticks + 1 } else { 0 };
                let elapsed = self.ticks_in_phase as f64 * CONTROL_DT;
                let has_rested = self.resting_ticks as f64 * CONTROL_DT >= protocol.rest_seconds;
                if has_rested
                    || elapsed >= protocol.policy_seconds && self.planned_states.len() == 0
                {
                    self.start_lift(context);
                }
            }
            Phase::Lift | Phase::Hold => self.check_hold(context),
            Phase::Done => {}
        }
        self.finish_replay();
    }

    fn is_replay(&self) -> bool {
        matches!(self.controller, Controller::Replay(_))
    }

    /// Starts phases at the recorded ticks.
    fn replay_phases(&mut self, context: &RolloutContext) {
        let Controller::Replay(RecordedTrajectory { phase_starts: marks, .. }) = &self.controller
        else {
            return;
        };
        let is_at = |start: Option<usize>| start.is_some_and(|tick| self.ticks() >= tick);
        if is_at(marks.lift) {
            self.start_lift(context);
        } else if is_at(marks.policy) && self.phase == Phase::Approach {
            self.start_policy();
        }
    }

    /// Ends a replay. If the recorded attempt failed before the hold, its recorded outcome is used.
    pub(crate) fn finish_replay(&mut self) {
        let Controller::Replay(RecordedTrajectory { outcome, .. }) = self.controller else {
            return;
        };
        let is_over = self.planned_states.len() == 0 && self.outcome.is_none();
        if is_over && self.phase_starts.hold.is_none() {
            match outcome {
                Some(Outcome::Failed { reason }) => self.fail(reason),
                // A replay evaluates the hold itself. A truncated recording does not show it.
                Some(Outcome::Lifted { .. }) => {
                    let end = self.scene.object_pose().translation;
                    self.fail(self.contact_history.failure_reason(end, HoldFailure::TooLow));
                }
                None => {}
            }
        }
    }

    fn start_policy(&mut self) {
        self.phase_starts.policy = Some(self.ticks());
        self.enter_phase(Phase::Policy);
    }

    fn start_lift(&mut self, context: &RolloutContext) {
        self.phase_starts.lift = Some(self.ticks());
        self.hold_monitor = Some(HoldMonitor::new(&self.scene));
        self.enter_phase(Phase::Lift);
        if self.is_replay() {
            return;
        }
        let robot = &context.robot;
        let start = JointState::at_rest(self.commanded.q);
        match lift::plan(&robot.config, &robot.tree, &start) {
            Ok(Some(rows)) => {
                self.planned_states = rows.into_iter();
                self.planned_states.next();
            }
            _ => self.fail(FailureReason::NotFinite),
        }
    }

    fn check_hold(&mut self, context: &RolloutContext) {
        let protocol = &context.robot.config.protocol;
        let hold_ticks = (protocol.hold_seconds / CONTROL_DT).round() as usize;
        let Some(hold) = &mut self.hold_monitor else { return };
        hold.update(&self.scene);
        let slip = hold.slip;
        let failure = hold.failure(&self.scene, protocol);
        if self.phase == Phase::Lift {
            let is_up = match &self.controller {
                Controller::Replay(recording) => Some(self.ticks()) == recording.phase_starts.hold,
                _ => self.planned_states.len() == 0,
            };
            if is_up {
                self.phase_starts.hold = Some(self.ticks());
                self.enter_phase(Phase::Hold);
            }
            return;
        }
        if let Some(failure) = failure {
            let end = self.scene.object_pose().translation;
            return self.fail(self.contact_history.failure_reason(end, failure));
        }
        if self.ticks_in_phase >= hold_ticks {
            self.finish(Outcome::Lifted { slip });
        }
    }

    fn enter_phase(&mut self, phase: Phase) {
        self.phase = phase;
        self.ticks_in_phase = 0;
    }

    pub(crate) fn fail(&mut self, reason: FailureReason) {
        self.finish(Outcome::Failed { reason });
    }

    fn finish(&mut self, outcome: Outcome) {
        self.outcome = Some(outcome);
        self.final_state_hash = Some(self.scene.state_hash().to_hex().to_string());
        self.enter_phase(Phase::Done);
    }
}
