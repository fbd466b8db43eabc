//! State of an attempt that its driver advances: simulation, phase, hold criterion and outcome.
//!
//! In: commanded states and phase transitions of a driver. Out: measurements of the object, and the outcome.
//! Knows no controller, network or recording.

use crate::attempt::contact_history::ContactHistory;
use crate::attempt::evidence::{Evidence, Slip};
use crate::attempt::phase_clock::{PhaseClock, PhaseStarts};
use crate::attempt::setup::AttemptSetup;
use crate::attempt::{FailureReason, Outcome, Phase};
use crate::rollout_context::RolloutContext;
use robot::JointState;
use scene::config::{AttemptProtocol, CONTROL_DT};
use scene::{HoldFailure, HoldMonitor, Scene, SceneError};

/// Simulation, phase and outcome of an attempt.
pub(crate) struct AttemptState {
    scene: Scene,
    commanded: JointState,
    clock: PhaseClock,
    contact_history: ContactHistory,
    /// Reference of the hold criterion; `None` before the lift.
    hold_monitor: Option<HoldMonitor>,
    outcome: Option<Outcome>,
    /// Measurements at the outcome; `None` before it, and if they are not finite.
    evidence: Option<Evidence>,
    /// Hash of the simulation state at the outcome (hex).
    final_state_hash: Option<String>,
}

impl AttemptState {
    /// The arm at rest at home, before the first step.
    pub(crate) fn new(context: &RolloutContext, setup: &AttemptSetup) -> Result<Self, SceneError> {
        let (config, tree) = (&context.robot.config, &context.robot.tree);
        let home = config.home();
        Ok(Self {
            scene: Scene::new(config, tree, &setup.object, &setup.world_from_object, &home)?,
            commanded: JointState::at_rest(home),
            clock: PhaseClock::new(),
            contact_history: ContactHistory::new(setup.world_from_object.translation),
            hold_monitor: None,
            outcome: None,
            evidence: None,
            final_state_hash: None,
        })
    }

    /// Moves the simulated robot to the next commanded state, in one control period, and measures the object.
    pub(crate) fn track(&mut self, next: &JointState) {
        self.scene.track(&self.commanded, next);
        self.commanded = *next;
        self.clock.advance();
        self.contact_history.add_height(self.scene.object_height());
        if !self.scene.is_finite() {
            return self.fail(FailureReason::NotFinite);
        }
        if let Some(hold) = &mut self.hold_monitor {
            hold.update(&self.scene);
            self.contact_history.add_finger_contacts(self.scene.num_finger_contacts());
        }
    }

    /// Steps the simulation at the last commanded position. Phase and outcome do not change.
    pub(crate) fn hold_position(&mut self) {
        let state = self.rest_state();
        self.scene.track(&state, &state);
    }

    pub(crate) fn enter(&mut self, phase: Phase) {
        self.clock.enter(phase);
    }

    /// Starts the lift. The hold criterion refers to the current pose of the object in the palm.
    pub(crate) fn enter_lift(&mut self) {
        self.hold_monitor = Some(HoldMonitor::new(&self.scene));
        self.contact_history.add_finger_contacts(self.scene.num_finger_contacts());
        self.clock.enter(Phase::Lift);
    }

    /// Records contacts of the approach; returns its failure if the object has moved.
    pub(crate) fn approach_failure(&mut self) -> Option<FailureReason> {
        let contact = self.scene.contact_state();
        self.contact_history.add_approach_contact(contact.hand || contact.arm);
        self.contact_history.approach_failure(self.scene.object_pose().translation)
    }

    /// Ends the attempt if the object is lost, or has been held long enough.
    pub(crate) fn check_hold(&mut self, protocol: &AttemptProtocol) {
        let hold_ticks = (protocol.hold_seconds / CONTROL_DT).round() as usize;
        let Some(hold) = &self.hold_monitor else { return };
        if let Some(failure) = hold.failure(&self.scene, protocol) {
            self.fail_hold(failure);
        } else if self.clock.ticks_in_phase() >= hold_ticks {
            self.finish(Outcome::Lifted { slip: hold.slip });
        }
    }

    /// Ends the attempt with the reason of a failed hold criterion.
    pub(crate) fn fail_hold(&mut self, failure: HoldFailure) {
        let end = self.scene.object_pose().translation;
        self.fail(self.contact_history.hold_failure(end, failure));
    }

    pub(crate) fn fail(&mut self, reason: FailureReason) {
        self.finish(Outcome::Failed { reason });
    }

    fn finish(&mut self, outcome: Outcome) {
        self.outcome = Some(outcome);
        self.evidence = self.scene.is_finite().then(|| self.measure());
        self.final_state_hash = Some(self.scene.state_hash().to_hex().to_string());
        self.clock.enter(Phase::Done);
    }

    /// Measurements of the object now.
    fn measure(&self) -> Evidence {
        let fingers = self.scene.num_finger_contacts();
        let (_, palm) = self.scene.hand_contacts();
        let slip = self.hold_monitor.as_ref().map(Slip::from);
        let (height, pose) = (self.scene.object_height(), self.scene.object_pose());
        self.contact_history.evidence(&pose, height, slip).with_contacts(
            fingers,
            palm,
            self.scene.contact_state(),
        )
    }

    /// Measurements at the outcome; `None` before it, and if the simulation diverged.
    pub(crate) fn evidence(&self) -> Option<Evidence> {
        self.evidence
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    pub(crate) fn scene_mut(&mut self) -> &mut Scene {
        &mut self.scene
    }

    /// Commanded joint state.
    pub(crate) fn commanded(&self) -> &JointState {
        &self.commanded
    }

    /// Commanded position at rest.
    pub(crate) fn rest_state(&self) -> JointState {
        JointState::at_rest(self.commanded.q)
    }

    /// Measured joint state.
    pub(crate) fn measured(&self) -> JointState {
        JointState { q: self.scene.joint_positions(), qd: self.scene.joint_velocities() }
    }

    pub(crate) fn phase(&self) -> Phase {
        self.clock.phase()
    }

    /// Number of control periods so far.
    pub(crate) fn ticks(&self) -> usize {
        self.clock.ticks()
    }

    /// Number of control periods since the start of the phase.
    pub(crate) fn ticks_in_phase(&self) -> usize {
        self.clock.ticks_in_phase()
    }

    pub(crate) fn phase_starts(&self) -> PhaseStarts {
        self.clock.starts()
    }

    pub(crate) fn outcome(&self) -> Option<Outcome> {
        self.outcome
    }

    /// Hash of the current state, or of the state at the outcome (hex).
    pub(crate) fn state_hash(&self) -> String {
        let now = || self.scene.state_hash().to_hex().to_string();
        self.final_state_hash.clone().unwrap_or_else(now)
    }
}
