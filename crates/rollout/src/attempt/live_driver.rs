//! Commanded states of a live attempt: planned states where there are any, otherwise the policy's steps.

use crate::attempt::approach::Approach;
use crate::attempt::attempt_state::AttemptState;
use crate::attempt::controller::{ControllerProperties, Feedback, Motion};
use crate::attempt::driver::PlannedStates;
use crate::attempt::{FailureReason, Phase};
use crate::rollout_context::RolloutContext;
use policy::{Model, NetworkInput, Observation};
use robot::{JointState, JointVector, integrator};
use scene::config::CONTROL_DT;

/// A controller in its attempt.
pub(crate) struct LiveDriver {
    pub(super) controller: ControllerProperties,
    /// Observation of the object, made once before the first step.
    observation: Option<Observation>,
    /// Approach, scripted or planned motion, and lift.
    pub(super) planned: PlannedStates,
    pub(super) approach_ticks: usize,
    /// Control periods at rest in the policy phase.
    pub(super) resting_ticks: usize,
}

impl LiveDriver {
    pub(crate) fn new(controller: ControllerProperties, approach: Approach) -> Self {
        Self {
            controller,
            observation: approach.observation,
            planned: PlannedStates::new(approach.states),
            approach_ticks: approach.approach_ticks,
            resting_ticks: 0,
        }
    }

    /// The next commanded state, or the reason why there is none. `qdd` is that of the network for
    /// [`Self::network_input`].
    pub(crate) fn next_state(
        &mut self,
        state: &AttemptState,
        context: &RolloutContext,
        qdd: Option<JointVector>,
    ) -> Result<JointState, FailureReason> {
        if self.network_input(state, context).is_some() {
            let qdd = qdd.ok_or(FailureReason::NotFinite)?;
            return Ok(self.policy_step(state, context, &qdd));
        }
        Ok(self.planned.next().unwrap_or_else(|| state.rest_state()))
    }

    /// Input of the network if it computes the next step: in the policy phase, after all planned states.
    pub(crate) fn network_input(
        &self,
        state: &AttemptState,
        context: &RolloutContext,
    ) -> Option<NetworkInput<'_>> {
        let is_policy_step = self.planned.is_finished() && state.phase() == Phase::Policy;
        let observation = self.observation.as_ref().filter(|_| is_policy_step)?;
        self.network(context)?;
        Some(observation.network_input(&self.feedback(state)))
    }

    /// Joint state from which the policy steps.
    fn feedback(&self, state: &AttemptState) -> JointState {
        match self.controller.feedback {
            Feedback::Measured => state.measured(),
            Feedback::Commanded => *state.commanded(),
        }
    }

    /// One time step with q̈ of the network (Eq. 3 to 5).
    fn policy_step(
        &self,
        state: &AttemptState,
        context: &RolloutContext,
        qdd: &JointVector,
    ) -> JointState {
        let next = integrator::step(&self.feedback(state), qdd, CONTROL_DT); // Eq. 6, 7
        context.robot.tree.limits.clamp_state(&next)
    }

    /// The model and its observation, if the controller uses a network.
    pub(crate) fn network<'a>(
        &'a self,
        context: &'a RolloutContext,
    ) -> Option<(&'a Model, &'a Observation)> {
        let network = context.model.as_ref().zip(self.observation.as_ref());
        network.filter(|_| self.controller.motion == Motion::Network)
    }

    /// Observation of the object; `None` if the controller does not use the point cloud.
    pub(crate) fn observation(&self) -> Option<&Observation> {
        self.observation.as_ref()
    }

    /// Number of planned states before the start configuration.
    pub(crate) fn approach_ticks(&self) -> usize {
        self.approach_ticks
    }
}
