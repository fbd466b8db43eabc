//! A grasp attempt, stepped at the control rate.
//!
//! In: an object, a seed, and a controller or a recording. Out: an outcome, and the commanded states so far.
//! A driver, live or replay, moves the robot and the phases; see `live_driver`, `phases`, `replay_driver`.

mod approach;
mod attempt_state;
mod contact_history;
mod controller;
mod demonstration_library;
mod driver;
mod evidence;
mod live_driver;
mod lockstep;
mod outcome;
mod phase_clock;
mod phases;
mod replay_driver;
mod setup;
mod start_selection;

pub use controller::Controller;
pub use demonstration_library::DemonstrationLibrary;
pub use evidence::{Evidence, Slip};
pub use lockstep::Lockstep;
pub use outcome::{FailureReason, Outcome};
pub(crate) use phase_clock::PhaseStarts;
pub use phases::Phase;
pub(crate) use replay_driver::RecordedTrajectory;
pub use setup::sample_object_pose;
use setup::sample_start_target;
pub(crate) use setup::{AttemptSetup, sample_pose_with_rng};
pub use start_selection::policy_ends;

use crate::interaction::Disturbance;
use crate::rollout_context::{RolloutContext, RolloutError};
use approach::{Approach, ApproachInputs};
use attempt_state::AttemptState;
use driver::Driver;
use geometry::Vec3;
use live_driver::LiveDriver;
use objects::object::Object;
use policy::{Model, NetworkInput, Observation};
use replay_driver::ReplayDriver;
use robot::{JointState, JointVector};
use scene::{ContactForce, Scene};
use std::ops::RangeInclusive;

/// A grasp attempt in progress.
///
/// ```rust
/// use rollout::{Attempt, Controller, Phase, RolloutContext};
/// let context = RolloutContext::new()?;
/// let object = objects::Object::from_catalog("sugar_box").expect("a built-in object");
/// // No pose is given, so it is sampled from the seed 0. The planner needs no model.
/// let mut attempt = Attempt::new(&context, &object, "sugar_box", None, 0, Controller::Planner)?;
/// let [x, y, _yaw] = attempt.pose(); // m, m, rad
/// assert!(context.robot.config.workspace.contains([x, y]));
/// // One control period of 1/30 s; `attempt.run(&context)` steps to the outcome.
/// attempt.step(&context);
/// assert_eq!((attempt.ticks(), attempt.phase()), (1, Phase::Approach));
/// assert!(attempt.outcome().is_none());
/// # Ok::<(), rollout::RolloutError>(())
/// ```
pub struct Attempt {
    setup: AttemptSetup,
    driver: Driver,
    state: AttemptState,
    /// Commanded states: the initial state and one per tick.
    history: Vec<JointState>,
    disturbance: Disturbance,
}

impl Attempt {
    /// Samples the object pose (unless given), captures and encodes a cloud, and plans the approach.
    ///
    /// `pose`: x, y (m), yaw (rad) of the object, world frame. `name`: name of a built-in object for
    /// [`Controller::Planner`], which looks up its grasps; any name for other controllers.
    pub fn new(
        context: &RolloutContext,
        object: &Object,
        name: &str,
        pose: Option<[f32; 3]>,
        seed: u64,
        controller: Controller,
    ) -> Result<Self, RolloutError> {
        let (setup, mut rng) = AttemptSetup::sample(context, object, name, pose, seed)?;
        let target =
            sample_start_target(&context.robot, &setup.object, &setup.world_from_object, &mut rng);
        let mut state = AttemptState::new(context, &setup)?;
        let inputs = ApproachInputs { context, setup: &setup, target };
        let approach = controller.plan(&inputs, &mut rng)?.unwrap_or_else(|failure| {
            state.fail(failure);
            Approach::default()
        });
        let driver = Driver::Live(LiveDriver::new(controller.properties(), approach));
        Ok(Self::with_driver(setup, state, driver))
    }

    /// Starts the replay of a recorded attempt with this object, pose and seed.
    pub(crate) fn replay(
        context: &RolloutContext,
        object: &Object,
        name: &str,
        pose: [f32; 3],
        seed: u64,
        recording: RecordedTrajectory,
    ) -> Result<Self, RolloutError> {
        let (setup, _) = AttemptSetup::sample(context, object, name, Some(pose), seed)?;
        let mut state = AttemptState::new(context, &setup)?;
        let driver = Driver::Replay(ReplayDriver::new(recording, &mut state));
        Ok(Self::with_driver(setup, state, driver))
    }

    fn with_driver(setup: AttemptSetup, state: AttemptState, driver: Driver) -> Self {
        let history = vec![*state.commanded()];
        Self { setup, driver, state, history, disturbance: Disturbance::default() }
    }

    /// Advances the attempt by one control period.
    pub fn step(&mut self, context: &RolloutContext) {
        let input = self.network_input(context).zip(context.model.as_ref());
        let qdd = input.and_then(|(input, model)| model.network.accelerations(&[input]).pop()?);
        self.step_with(context, qdd);
    }

    /// Input of the network if it computes the next step; `None` in other phases and for other controllers.
    pub(crate) fn network_input(&self, context: &RolloutContext) -> Option<NetworkInput<'_>> {
        self.driver.live()?.network_input(&self.state, context)
    }

    /// Advances the attempt by one control period, with q̈ of the network for [`Self::network_input`]; `None`
    /// if q̈ is not finite, or if the network does not compute this step.
    pub(crate) fn step_with(&mut self, context: &RolloutContext, qdd: Option<JointVector>) {
        if self.phase() == Phase::Done {
            return;
        }
        self.disturbance.record_step();
        let next = match self.driver.next_state(&self.state, context, qdd) {
            Ok(next) => next,
            Err(reason) => return self.state.fail(reason),
        };
        self.state.track(&next);
        self.history.push(next);
        self.driver.update_phase(&mut self.state, context);
    }

    /// Steps until there is an outcome.
    pub fn run(&mut self, context: &RolloutContext) -> Outcome {
        loop {
            if let Some(outcome) = self.outcome() {
                return outcome;
            }
            self.step(context);
        }
    }

    /// Steps one control period after the outcome, which does not change. The hand keeps its
    /// commanded position.
    pub fn step_after_outcome(&mut self) {
        self.state.hold_position();
    }

    /// Drags a point of the object (m, object frame) towards a target (m, world frame); `None` releases it. A
    /// drag during a step makes the attempt irreproducible from its seed.
    pub fn drag(&mut self, drag: Option<(Vec3, Vec3)>) {
        self.disturbance.drag(self.state.scene_mut(), drag);
    }

    /// Whether the user is dragging the object.
    pub fn is_disturbed(&self) -> bool {
        self.disturbance.is_active()
    }

    /// Whether the user dragged the object before the outcome.
    pub fn was_disturbed(&self) -> bool {
        self.disturbance.was_active()
    }

    /// Current phase.
    pub fn phase(&self) -> Phase {
        self.state.phase()
    }

    /// Outcome, after the end of the attempt.
    pub fn outcome(&self) -> Option<Outcome> {
        self.state.outcome()
    }

    /// Measurements of the object at the outcome. `None` before the outcome, and for an attempt that could not
    /// start or that diverged.
    pub fn evidence(&self) -> Option<Evidence> {
        self.state.evidence().filter(|_| self.ticks() > 0)
    }

    /// The outcome in one sentence, refined by its evidence; `None` before the outcome.
    pub fn description(&self) -> Option<&'static str> {
        let outcome = self.outcome()?;
        let evidence = self.evidence();
        Some(evidence.map_or(outcome.description(), |evidence| evidence.describe(outcome)))
    }

    /// Number of control periods so far.
    pub fn ticks(&self) -> usize {
        self.state.ticks()
    }

    /// The simulated scene.
    pub fn scene(&self) -> &Scene {
        self.state.scene()
    }

    /// Commanded joint state.
    pub fn commanded_state(&self) -> &JointState {
        self.state.commanded()
    }

    /// Captured point cloud (m), base frame.
    pub fn cloud(&self) -> &[Vec3] {
        &self.setup.cloud
    }

    /// Initial pose of the object: x, y (m), yaw (rad), world frame.
    pub fn pose(&self) -> [f32; 3] {
        self.setup.pose
    }

    /// Seed of all random samples of the attempt.
    pub fn seed(&self) -> u64 {
        self.setup.seed
    }

    /// Hash of the current state, or of the state at the outcome (hex).
    pub fn state_hash(&self) -> String {
        self.state.state_hash()
    }

    /// Current contact forces on the object.
    pub fn contact_forces(&self) -> Vec<ContactForce> {
        self.state.scene().contact_forces()
    }

    pub(crate) fn setup(&self) -> &AttemptSetup {
        &self.setup
    }

    /// Commanded states: the initial state and one per tick.
    pub(crate) fn history(&self) -> &[JointState] {
        &self.history
    }

    pub(crate) fn phase_starts(&self) -> PhaseStarts {
        self.state.phase_starts()
    }

    /// Ticks between start configuration and lift.
    pub(crate) fn policy_ticks(&self) -> RangeInclusive<usize> {
        self.driver.approach_ticks()..=self.phase_starts().lift.unwrap_or(self.ticks())
    }

    /// Commanded states between start configuration and lift; empty if the policy phase was not reached.
    pub(crate) fn policy_segment(&self) -> &[JointState] {
        self.history.get(self.policy_ticks()).unwrap_or_default()
    }

    /// Observation of the object; `None` if the controller does not use the point cloud.
    pub(crate) fn observation(&self) -> Option<&Observation> {
        self.driver.live()?.observation()
    }

    /// The model and its observation, if the controller uses a network.
    pub(crate) fn network<'a>(
        &'a self,
        context: &'a RolloutContext,
    ) -> Option<(&'a Model, &'a Observation)> {
        self.driver.live()?.network(context)
    }
}
