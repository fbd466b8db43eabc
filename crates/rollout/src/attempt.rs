//! A grasp attempt. Object pose, sensor noise and start target are sampled from its seed, in this order.

use crate::approach::{ApproachInputs, capture_cloud};
use crate::controller::Controller;
use crate::motion_metrics::{self, MotionMetrics};
use crate::outcome::{ContactHistory, FailureReason, Outcome};
use crate::phases::Phase;
use crate::recording::{AttemptRecording, PhaseStarts, from_row, to_row};
use crate::rollout_context::{RolloutContext, RolloutError};
use crate::telemetry::TelemetrySample;
use geometry::Vec3;
use grasps::plan::{demonstration, object_poses};
use grasps::{PlacedObject, RobotContext};
use objects::object::Object;
use policy::{Model, Observation};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{Isometry, JointState, integrator, rotation};
use scene::config::CONTROL_DT;
use scene::scene_hash;
use scene::{HoldMonitor, Scene, Simulation};
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
    pub(crate) scene: Scene,
    object: Object,
    object_name: String,
    pose: [f32; 3],
    seed: u64,
    pub(crate) controller: Controller,
    cloud: Vec<Vec3>,
    pub(crate) observation: Option<Observation>,
    pub(crate) commanded: JointState,
    pub(crate) planned_states: std::vec::IntoIter<JointState>,
    pub(crate) phase: Phase,
    pub(crate) ticks_in_phase: usize,
    pub(crate) resting_ticks: usize,
    pub(crate) approach_ticks: usize,
    pub(crate) phase_starts: PhaseStarts,
    pub(crate) hold_monitor: Option<HoldMonitor>,
    pub(crate) contact_history: ContactHistory,
    pub(crate) outcome: Option<Outcome>,
    /// Hash of the simulation state at the outcome (hex).
    pub(crate) final_state_hash: Option<String>,
    pub(crate) is_disturbed: bool,
    pub(crate) was_disturbed: bool,
    targets: Vec<Vec<f64>>,
}

/// Max absolute value of the object's coordinates (m) and yaw (rad).
const MAX_COORDINATE: f32 = 100.0;

/// Samples the object pose of a seed: x, y (m), yaw (rad).
pub fn sample_object_pose(robot: &RobotContext, seed: u64) -> [f32; 3] {
    sample_pose_with_rng(robot, seed).0
}

/// Samples the object pose and returns the generator for all further samples of the attempt.
pub(crate) fn sample_pose_with_rng(robot: &RobotContext, seed: u64) -> ([f32; 3], ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (object_poses::sample_planar_pose(robot, &mut rng), rng)
}

impl Attempt {
    /// Samples the object pose (unless given), captures and encodes a cloud, and plans the approach.
    pub fn new(
        context: &RolloutContext,
        object: &Object,
        name: &str,
        pose: Option<[f32; 3]>,
        seed: u64,
        controller: Controller,
    ) -> Result<Self, RolloutError> {
        let robot = &context.robot;
        let (drawn, mut rng) = sample_pose_with_rng(robot, seed);
        let pose = pose.unwrap_or(drawn);
        if !pose.iter().all(|number| number.abs() < MAX_COORDINATE) {
            return Err(RolloutError::OffTheTable);
        }
        let world_from_object = robot.config.object_pose(pose[0], pose[1], pose[2]);
        let cloud = capture_cloud(context, object, &world_from_object, &mut rng);
        let nominal_palm =
            robot.tree.forward_kinematics(&robot.nominal_facing(&world_from_object)).palm_pose();
        let target = demonstration::sample_pregrasp_pose(
            robot,
            &object.bounds,
            &world_from_object,
            &nominal_palm,
            &mut rng,
        );

        let home = robot.config.home();
        let mut attempt = Self {
            scene: Scene::new(&robot.config, &robot.tree, object, &world_from_object, &home)?,
            object: object.clone(),
            object_name: name.to_owned(),
            pose,
            seed,
            controller,
            cloud,
            observation: None,
            commanded: JointState::at_rest(home),
            planned_states: Vec::new().into_iter(),
            phase: Phase::Approach,
            ticks_in_phase: 0,
            resting_ticks: 0,
            approach_ticks: 0,
            phase_starts: PhaseStarts::default(),
            hold_monitor: None,
            contact_history: ContactHistory {
                start_position: world_from_object.translation,
                max_height: 0.0,
                was_touched: false,
            },
            outcome: None,
            final_state_hash: None,
            is_disturbed: false,
            was_disturbed: false,
            targets: Vec::new(),
        };
        attempt.targets.push(to_row(&attempt.commanded));
        let inputs = ApproachInputs {
            context,
            object,
            object_name: name,
            world_from_object,
            cloud: &attempt.cloud,
            target,
            home,
        };
        match inputs.plan(&attempt.controller, &mut rng)? {
            Ok(approach) => {
                attempt.approach_ticks = approach.approach_ticks;
                attempt.observation = approach.observation;
                attempt.planned_states = approach.states.into_iter();
            }
            Err(failure) => attempt.fail(failure),
        }
        attempt.finish_replay();
        Ok(attempt)
    }

    /// Advances the attempt by one control period.
    pub fn step(&mut self, context: &RolloutContext) {
        if self.phase == Phase::Done {
            return;
        }
        self.was_disturbed |= self.is_disturbed;
        self.ticks_in_phase += 1;
        let Some(next) = self.next_state(context) else { return };
        self.scene.track(&self.commanded, &next);
        self.commanded = next;
        self.targets.push(to_row(&next));
        self.update_phase(context);
    }

    /// The next commanded state; `None` if the attempt has failed.
    fn next_state(&mut self, context: &RolloutContext) -> Option<JointState> {
        let planned = self.planned_states.next();
        let is_free = self.phase == Phase::Policy && planned.is_none();
        let next = match planned {
            Some(next) => next,
            None if is_free => self.policy_step(context)?,
            None => JointState::at_rest(self.commanded.q),
        };
        Some(next)
    }

    fn policy_step(&mut self, context: &RolloutContext) -> Option<JointState> {
        let Some((model, observation)) = self.active_network(context) else {
            return Some(JointState::at_rest(self.commanded.q));
        };
        let state = match self.controller {
            Controller::PolicyMeasured => self.measured_state(),
            _ => self.commanded,
        };
        let Some(qdd) = observation.acceleration(&model.network, &state) else {
            self.fail(FailureReason::NotFinite);
            return None;
        };
        let next = integrator::step(&state, &qdd, CONTROL_DT);
        Some(context.robot.tree.limits.clamp_state(&next))
    }

    /// Current phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Outcome, after the end of the attempt.
    pub fn outcome(&self) -> Option<Outcome> {
        self.outcome
    }

    /// Number of control periods so far.
    pub fn ticks(&self) -> usize {
        self.targets.len() - 1
    }

    /// The simulated scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Measured joint state.
    fn measured_state(&self) -> JointState {
        JointState { q: self.scene.joint_positions(), qd: self.scene.joint_velocities() }
    }

    /// Commanded joint state.
    pub fn commanded_state(&self) -> &JointState {
        &self.commanded
    }

    /// Captured point cloud (m), base frame.
    pub fn cloud(&self) -> &[Vec3] {
        &self.cloud
    }

    /// Initial pose of the object: x, y (m), yaw (rad).
    pub fn pose(&self) -> [f32; 3] {
        self.pose
    }

    /// Seed of all random samples of the attempt.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Hash of the current state, or of the state at the outcome (hex).
    pub fn state_hash(&self) -> String {
        let now = || self.scene.state_hash().to_hex().to_string();
        self.final_state_hash.clone().unwrap_or_else(now)
    }

    /// Steps until there is an outcome.
    pub fn run(&mut self, context: &RolloutContext) -> Outcome {
        loop {
            if let Some(outcome) = self.outcome {
                return outcome;
            }
            self.step(context);
        }
    }

    /// Commanded states between start configuration and lift; empty if the policy phase was not reached.
    fn policy_segment(&self) -> Vec<JointState> {
        let rows = self.targets.get(self.policy_ticks()).unwrap_or_default();
        rows.iter().map(|row| from_row(row)).collect()
    }

    fn policy_ticks(&self) -> RangeInclusive<usize> {
        self.approach_ticks..=self.phase_starts.lift.unwrap_or(self.ticks())
    }

    /// Motion metrics between start configuration and lift; `None` if the policy phase was not reached.
    pub fn motion_metrics(&self) -> Option<MotionMetrics> {
        MotionMetrics::from_states(&self.policy_segment())
    }

    /// Min distance (m) of the robot to the table and to the object at its initial pose, up to 0.1 m.
    ///
    /// The interval is from the start configuration to 0.4 s before the first contact. `None` if it is empty.
    pub fn clearance(&self, context: &RolloutContext) -> Option<f32> {
        let [x, y, yaw] = self.pose;
        let world_from_object = context.robot.config.object_pose(x, y, yaw);
        motion_metrics::clearance(
            &PlacedObject::new(&context.robot, &self.object, &world_from_object),
            &self.policy_segment(),
        )
    }

    /// Palm pose relative to the object's initial pose, at the start of the lift; `None` without a lift.
    pub fn object_from_palm(&self, context: &RolloutContext) -> Option<Isometry> {
        let row = self.targets.get(self.phase_starts.lift?)?;
        let robot = &context.robot;
        let [x, y, yaw] = self.pose;
        let world_from_object = rotation::to_isometry(&robot.config.object_pose(x, y, yaw));
        let palm = robot.tree.forward_kinematics(&from_row(row).q).palm_pose();
        Some(world_from_object.inverse() * palm)
    }

    /// The model and its observation, if the controller uses a network.
    fn active_network<'a>(
        &'a self,
        context: &'a RolloutContext,
    ) -> Option<(&'a Model, &'a Observation)> {
        let network = context.model.as_ref().zip(self.observation.as_ref());
        network.filter(|_| self.controller.uses_network())
    }

    /// Telemetry at a tick, or at the last one. Fabric terms are available between start and lift.
    pub fn telemetry_at(&self, context: &RolloutContext, tick: usize) -> TelemetrySample {
        let state = self.targets.get(tick).map_or(self.commanded, |row| from_row(row));
        let network = self.active_network(context).filter(|_| self.policy_ticks().contains(&tick));
        TelemetrySample::new(&state, &context.robot.tree.limits, network)
    }

    /// Telemetry of each tick between start and lift; empty if the policy phase was not reached.
    pub fn telemetry(&self, context: &RolloutContext) -> Vec<TelemetrySample> {
        let ticks = self.policy_ticks().take_while(|tick| *tick < self.targets.len());
        ticks.map(|tick| self.telemetry_at(context, tick)).collect()
    }

    /// Recording of the attempt so far.
    pub fn recording(&self) -> AttemptRecording {
        AttemptRecording {
            scene_hash: scene_hash(),
            object_hash: self.object.hash(),
            object_name: self.object_name.clone(),
            object_pose: self.pose,
            seed: self.seed,
            targets: self.targets.clone(),
            policy_tick: self.phase_starts.policy,
            lift_tick: self.phase_starts.lift,
            hold_tick: self.phase_starts.hold,
            outcome: self.outcome,
            final_state_hash: self.state_hash(),
        }
    }
}
