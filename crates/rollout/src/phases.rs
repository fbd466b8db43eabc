//! The phases of an attempt: when one gives way to the next, and how it ends.

use crate::approach::script;
use crate::attempt::Attempt;
use crate::controller::Controller;
use crate::episode::Recording;
use crate::verdict::{Failure, Verdict};
use crate::workcell::Workcell;
use grasps::lift;
use robot::JointState;
use scene::config::CONTROL_PERIOD;
use scene::{Hold, Loss, Simulation};

/// Distance (m) by which the object may move during the approach.
const APPROACH_SHIFT: f32 = 0.01;

/// What is going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// The spline leads to the start configuration.
    Approach,
    /// The controller acts.
    Policy,
    /// The fabric lifts.
    Lift,
    /// The arm holds.
    Hold,
    /// There is a verdict.
    Done,
}

impl Attempt {
    /// Looks at the world after a tick and moves on to the next phase when it is time.
    pub(crate) fn observe(&mut self, workcell: &Workcell) {
        let protocol = &workcell.robot.config.attempt;
        self.story.highest = self.story.highest.max(self.scene.object_height());
        if !self.scene.is_finite() {
            return self.fail(Failure::NotFinite);
        }
        let object = self.scene.object_pose().translation;
        match self.phase {
            Phase::Approach | Phase::Policy if self.is_replay() => self.follow_marks(workcell),
            Phase::Approach => {
                let touching = self.scene.touching();
                self.story.is_touched |= touching.hand || touching.arm;
                let is_shifted = object.distance(self.story.start) > APPROACH_SHIFT;
                if is_shifted && !self.controller.knows_the_place() {
                    let is_touched = self.story.is_touched;
                    return self.fail(if is_touched {
                        Failure::Collided
                    } else {
                        Failure::Shifted
                    });
                }
                if self.controller.is_planned() {
                    if self.phase_ticks >= self.approach_ticks {
                        self.begin_policy();
                    }
                } else if self.plan.len() == 0 {
                    self.begin_policy();
                    if matches!(self.controller, Controller::Script) {
                        self.plan = script(&self.state.q, workcell).into_iter();
                    }
                }
            }
            Phase::Policy => {
                let rests = self.state.qd.norm() < protocol.rest_speed && self.plan.len() == 0;
                self.resting_ticks = if rests { self.resting_ticks + 1 } else { 0 };
                let elapsed = self.phase_ticks as f64 * CONTROL_PERIOD;
                let rested = self.resting_ticks as f64 * CONTROL_PERIOD >= protocol.rest_seconds;
                if rested || elapsed >= protocol.policy_seconds && self.plan.len() == 0 {
                    self.begin_lift(workcell);
                }
            }
            Phase::Lift | Phase::Hold => self.judge(workcell),
            Phase::Done => {}
        }
        self.end_replay();
    }

    fn is_replay(&self) -> bool {
        matches!(self.controller, Controller::Replay(_))
    }

    /// Moves on where the recorded attempt did.
    fn follow_marks(&mut self, workcell: &Workcell) {
        let Controller::Replay(Recording { marks, .. }) = &self.controller else { return };
        let is_at = |mark: Option<usize>| mark.is_some_and(|tick| self.ticks() >= tick);
        if is_at(marks.lift) {
            self.begin_lift(workcell);
        } else if is_at(marks.policy) && self.phase == Phase::Approach {
            self.begin_policy();
        }
    }

    /// At the end of what was recorded: what failed before the hold has nothing to judge, and its verdict is the
    /// recorded one.
    pub(crate) fn end_replay(&mut self) {
        let Controller::Replay(Recording { verdict, .. }) = self.controller else { return };
        let is_over = self.plan.len() == 0 && self.verdict.is_none();
        if is_over && self.marks.hold.is_none() {
            match verdict {
                Some(Verdict::Failed { reason }) => self.fail(reason),
                // That something was held is judged here, and a recording that was cut short does not show it.
                Some(Verdict::Lifted { .. }) => {
                    let end = self.scene.object_pose().translation;
                    self.fail(self.story.reason(end, Loss::Low));
                }
                None => {}
            }
        }
    }

    fn begin_policy(&mut self) {
        self.marks.policy = Some(self.ticks());
        self.enter(Phase::Policy);
    }

    fn begin_lift(&mut self, workcell: &Workcell) {
        self.marks.lift = Some(self.ticks());
        self.hold = Some(Hold::begin(&self.scene));
        self.enter(Phase::Lift);
        if self.is_replay() {
            return;
        }
        let robot = &workcell.robot;
        let start = JointState::at_rest(self.state.q);
        match lift::plan(&robot.config, &robot.tree, &start) {
            Ok(Some(rows)) => {
                self.plan = rows.into_iter();
                self.plan.next();
            }
            _ => self.fail(Failure::NotFinite),
        }
    }

    fn judge(&mut self, workcell: &Workcell) {
        let protocol = &workcell.robot.config.attempt;
        let hold_ticks = (protocol.hold_seconds / CONTROL_PERIOD).round() as usize;
        let Some(hold) = &mut self.hold else { return };
        hold.observe(&self.scene);
        let slip = hold.slip;
        let loss = hold.loss(&self.scene, protocol);
        if self.phase == Phase::Lift {
            let is_up = match &self.controller {
                Controller::Replay(recording) => Some(self.ticks()) == recording.marks.hold,
                _ => self.plan.len() == 0,
            };
            if is_up {
                self.marks.hold = Some(self.ticks());
                self.enter(Phase::Hold);
            }
            return;
        }
        if let Some(loss) = loss {
            let end = self.scene.object_pose().translation;
            return self.fail(self.story.reason(end, loss));
        }
        if self.phase_ticks >= hold_ticks {
            self.finish(Verdict::Lifted { slip });
        }
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.phase_ticks = 0;
    }

    pub(crate) fn fail(&mut self, reason: Failure) {
        self.finish(Verdict::Failed { reason });
    }

    fn finish(&mut self, verdict: Verdict) {
        self.verdict = Some(verdict);
        self.end = Some(self.scene.state_hash().to_hex().to_string());
        self.enter(Phase::Done);
    }
}
