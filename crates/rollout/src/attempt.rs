//! The attempt itself. A run is its seed: pose, sensor noise and target are drawn from it in this order.

use crate::approach::{Sight, look};
use crate::controller::Controller;
use crate::course::Moment;
use crate::episode::{Episode, Marks, row_of, state_of_row};
use crate::motion::{self, Motion};
use crate::phases::Phase;
use crate::verdict::{Failure, Story, Verdict};
use crate::workcell::{RolloutError, Workcell};
use geometry::Vec3;
use geometry::object::Object;
use grasps::{Robot, Setting, demonstration, place};
use policy::{Encoding, Model};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{Isometry, JointState, integrator, rotation};
use scene::config::{CONTROL_PERIOD, scene_hash};
use scene::{Hold, Scene, Simulation};
use std::ops::RangeInclusive;

/// An attempt in progress.
pub struct Attempt {
    pub(crate) scene: Scene,
    object: Object,
    name: String,
    pose: [f32; 3],
    seed: u64,
    pub(crate) controller: Controller,
    cloud: Vec<Vec3>,
    pub(crate) encoding: Option<Encoding>,
    pub(crate) state: JointState,
    pub(crate) plan: std::vec::IntoIter<JointState>,
    pub(crate) phase: Phase,
    pub(crate) phase_ticks: usize,
    pub(crate) resting_ticks: usize,
    pub(crate) approach_ticks: usize,
    pub(crate) marks: Marks,
    pub(crate) hold: Option<Hold>,
    pub(crate) story: Story,
    pub(crate) verdict: Option<Verdict>,
    /// The world's hash at the verdict.
    pub(crate) end: Option<String>,
    pub(crate) is_pulled: bool,
    pub(crate) was_pulled: bool,
    targets: Vec<Vec<f64>>,
}

/// Nothing stands so far away (m), or is turned so often (rad).
const FARTHEST: f32 = 100.0;

/// Where an attempt puts the object if it is not told: x, y (m), yaw (rad).
pub fn pose_of_seed(robot: &Robot, seed: u64) -> [f32; 3] {
    drawn_pose(robot, seed).0
}

/// The pose is the first thing that an attempt draws; the rest follows from the same generator.
pub(crate) fn drawn_pose(robot: &Robot, seed: u64) -> ([f32; 3], ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (place::random_pose(robot, &mut rng), rng)
}

impl Attempt {
    /// Draws the pose (unless given), takes the frame, encodes it, finds the start configuration.
    pub fn begin(
        workcell: &Workcell,
        object: &Object,
        name: &str,
        pose: Option<[f32; 3]>,
        seed: u64,
        controller: Controller,
    ) -> Result<Self, RolloutError> {
        let robot = &workcell.robot;
        let (drawn, mut rng) = drawn_pose(robot, seed);
        let pose = pose.unwrap_or(drawn);
        if !pose.iter().all(|number| number.abs() < FARTHEST) {
            return Err(RolloutError::OffTheTable);
        }
        let world_from_object = robot.config.upright(pose[0], pose[1], pose[2]);
        let cloud = look(workcell, object, &world_from_object, &mut rng);
        let nominal_palm = robot.tree.kinematics(&robot.nominal_towards(&world_from_object)).palm();
        let (region, bounds) = (&robot.config.target, &object.bounds);
        let target =
            demonstration::draw_target(region, bounds, &world_from_object, &nominal_palm, &mut rng);

        let home = robot.config.home();
        let mut attempt = Self {
            scene: Scene::new(&robot.config, &robot.tree, object, &world_from_object, &home)?,
            object: object.clone(),
            name: name.to_owned(),
            pose,
            seed,
            controller,
            cloud,
            encoding: None,
            state: JointState::at_rest(home),
            plan: Vec::new().into_iter(),
            phase: Phase::Approach,
            phase_ticks: 0,
            resting_ticks: 0,
            approach_ticks: 0,
            marks: Marks::default(),
            hold: None,
            story: Story { start: world_from_object.translation, highest: 0.0, is_touched: false },
            verdict: None,
            end: None,
            is_pulled: false,
            was_pulled: false,
            targets: Vec::new(),
        };
        attempt.targets.push(row_of(&attempt.state));
        let sight = Sight {
            workcell,
            object,
            name,
            world_from_object,
            cloud: &attempt.cloud,
            target,
            home,
        };
        match sight.plan(&attempt.controller, &mut rng)? {
            Ok(approach) => {
                attempt.approach_ticks = approach.ticks;
                attempt.encoding = approach.encoding;
                attempt.plan = approach.rows.into_iter();
            }
            Err(failure) => attempt.fail(failure),
        }
        attempt.end_replay();
        Ok(attempt)
    }

    /// One control period.
    pub fn tick(&mut self, workcell: &Workcell) {
        if self.phase == Phase::Done {
            return;
        }
        self.was_pulled |= self.is_pulled;
        self.phase_ticks += 1;
        let Some(next) = self.next_state(workcell) else { return };
        self.scene.follow(&self.state, &next);
        self.state = next;
        self.targets.push(row_of(&next));
        self.observe(workcell);
    }

    /// The commanded state after this tick; `None` once there is a verdict.
    fn next_state(&mut self, workcell: &Workcell) -> Option<JointState> {
        let planned = self.plan.next();
        let is_free = self.phase == Phase::Policy && planned.is_none();
        let next = match planned {
            Some(next) => next,
            None if is_free => self.controlled(workcell)?,
            None => JointState::at_rest(self.state.q),
        };
        Some(next)
    }

    fn controlled(&mut self, workcell: &Workcell) -> Option<JointState> {
        let Some((model, object)) = self.network(workcell) else {
            return Some(JointState::at_rest(self.state.q));
        };
        let state = match self.controller {
            Controller::Measured => self.measured(),
            _ => self.state,
        };
        let Some(qdd) = object.acceleration(&model.network, &state) else {
            self.fail(Failure::NotFinite);
            return None;
        };
        let free = integrator::step(&state, &qdd, CONTROL_PERIOD);
        Some(workcell.robot.tree.limits.stop(&free))
    }

    /// What is going on.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// How it ended, once it has.
    pub fn verdict(&self) -> Option<Verdict> {
        self.verdict
    }

    /// Control periods so far.
    pub fn ticks(&self) -> usize {
        self.targets.len() - 1
    }

    /// The world as it is now.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The joints as they are.
    fn measured(&self) -> JointState {
        JointState { q: self.scene.joint_positions(), qd: self.scene.joint_velocities() }
    }

    /// The commanded state.
    pub fn commanded(&self) -> &JointState {
        &self.state
    }

    /// The cloud that the camera saw, base frame.
    pub fn cloud(&self) -> &[Vec3] {
        &self.cloud
    }

    /// Pose of the object at the beginning: x, y (m), yaw (rad).
    pub fn pose(&self) -> [f32; 3] {
        self.pose
    }

    /// The seed that decides everything in it.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Hash of the present state, or of that at the verdict, hex.
    pub fn state_hash(&self) -> String {
        let now = || self.scene.state_hash().to_hex().to_string();
        self.end.clone().unwrap_or_else(now)
    }

    /// Ticks through to the verdict.
    pub fn run(&mut self, workcell: &Workcell) -> Verdict {
        loop {
            if let Some(verdict) = self.verdict {
                return verdict;
            }
            self.tick(workcell);
        }
    }

    /// Commanded states between start and lift; none if the controller did not come to act.
    fn acted(&self) -> Vec<JointState> {
        let rows = self.targets.get(self.acted_ticks()).unwrap_or_default();
        rows.iter().map(|row| state_of_row(row)).collect()
    }

    fn acted_ticks(&self) -> RangeInclusive<usize> {
        self.approach_ticks..=self.marks.lift.unwrap_or(self.ticks())
    }

    /// How the controller moved between start and lift, if it came to act.
    pub fn motion(&self) -> Option<Motion> {
        Motion::of(&self.acted())
    }

    /// Least distance (m) of the robot from the table and the object, as it stood at the beginning, between start and
    /// 0.4 s before the first touch; at most 0.1. `None` if the controller did not come to act, or touched at once.
    pub fn clearance(&self, workcell: &Workcell) -> Option<f32> {
        let [x, y, yaw] = self.pose;
        let place = workcell.robot.config.upright(x, y, yaw);
        motion::clearance(&Setting::new(&workcell.robot, &self.object, &place), &self.acted())
    }

    /// Pose of the palm in the object, as it stood at the beginning, where the lift began; `None` if none did.
    pub fn object_from_palm(&self, workcell: &Workcell) -> Option<Isometry> {
        let row = self.targets.get(self.marks.lift?)?;
        let robot = &workcell.robot;
        let [x, y, yaw] = self.pose;
        let world_from_object = rotation::to_isometry(&robot.config.upright(x, y, yaw));
        let palm = robot.tree.kinematics(&state_of_row(row).q).palm();
        Some(world_from_object.inverse() * palm)
    }

    /// The model that acts, if one does, and what it is told of the object.
    fn network<'a>(&'a self, workcell: &'a Workcell) -> Option<(&'a Model, &'a Encoding)> {
        let known = workcell.model.as_ref().zip(self.encoding.as_ref());
        known.filter(|_| self.controller.is_of_model())
    }

    /// The moment after a tick, or the last one; a fabric acts between start and lift.
    pub fn moment(&self, workcell: &Workcell, tick: usize) -> Moment {
        let state = self.targets.get(tick).map_or(self.state, |row| state_of_row(row));
        let acts = self.network(workcell).filter(|_| self.acted_ticks().contains(&tick));
        Moment::of(&state, &workcell.robot.tree.limits, acts)
    }

    /// The moments between start and lift, a control period apart; none if the controller did not come to act.
    pub fn course(&self, workcell: &Workcell) -> Vec<Moment> {
        let ticks = self.acted_ticks().take_while(|tick| *tick < self.targets.len());
        ticks.map(|tick| self.moment(workcell, tick)).collect()
    }

    /// The recording so far.
    pub fn episode(&self) -> Episode {
        Episode {
            scene: scene_hash(),
            object: self.object.hash(),
            name: self.name.clone(),
            pose: self.pose,
            seed: self.seed,
            targets: self.targets.clone(),
            policy_tick: self.marks.policy,
            lift_tick: self.marks.lift,
            hold_tick: self.marks.hold,
            verdict: self.verdict,
            state_hash: self.state_hash(),
        }
    }
}
