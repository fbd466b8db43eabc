//! Commanded states of a live attempt: planned states where there are any, otherwise the policy's steps.

use crate::attempt::approach::Approach;
use crate::attempt::attempt_state::AttemptState;
use crate::attempt::controller::{ControllerProperties, Feedback, Motion};
use crate::attempt::driver::PlannedStates;
use crate::attempt::{FailureReason, Phase};
use crate::rollout_context::RolloutContext;
use policy::{Model, Observation};
use robot::{JointState, integrator};
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

    /// The next commanded state, or the reason why there is none.
    pub(crate) fn next_state(
        &mut self,
        state: &AttemptState,
        context: &RolloutContext,
    ) -> Result<JointState, FailureReason> {
        match self.planned.next() {
            Some(next) => Ok(next),
            None if state.phase() == Phase::Policy => self.policy_step(state, context),
            None => Ok(state.rest_state()),
        }
    }

    /// One step of the policy; without a network, the robot holds its position.
    fn policy_step(
        &self,
        state: &AttemptState,
        context: &RolloutContext,
    ) -> Result<JointState, FailureReason> {
        let Some((model, observation)) = self.network(context) else {
            return Ok(state.rest_state());
        };
        let from = match self.controller.feedback {
            Feedback::Measured => state.measured(),
            Feedback::Commanded => *state.commanded(),
        };
        let qdd = model.network.acceleration(&from, observation); // Eq. 3-5
        let qdd = qdd.ok_or(FailureReason::NotFinite)?;
        let next = integrator::step(&from, &qdd, CONTROL_DT); // Eq. 6, 7
        Ok(context.robot.tree.limits.clamp_state(&next))
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
