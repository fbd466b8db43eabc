//! The attempt itself. A run is its seed: pose, sensor noise and target are drawn from it in this order.

use crate::approach::{Sight, look, script};
use crate::course::Moment;
use crate::episode::{Episode, row_of, state_of_row};
use crate::library::Library;
use crate::motion::Motion;
use crate::verdict::{Failure, Story, Verdict};
use crate::workcell::{RolloutError, Workcell};
use geometry::Vec3;
use geometry::object::Object;
use grasps::grasp::Grasp;
use grasps::{Robot, demonstration, lift, place};
use policy::Encoding;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{JointState, JointVector, integrator};
use scene::config::{CONTROL_PERIOD, scene_hash};
use scene::{Hold, Scene, Simulation};
use std::sync::Arc;

/// Who moves the joints between start and lift.
#[derive(Clone, Debug)]
pub enum Controller {
    /// The learned policy (decision: it integrates its own commanded state).
    Policy,
    /// The learned policy with z of another object pose (control b).
    ShuffledLatent,
    /// The learned policy with z = 0 (control c).
    ZeroLatent,
    /// Fingers closed by script at the start configuration (control a).
    Script,
    /// A demonstration planned for this pose, with knowledge of the object.
    Planner,
    /// The same with these grasps.
    Found(Arc<Vec<Grasp>>),
    /// A demonstration that was made for this pose.
    Demonstration(Vec<JointState>),
    /// The demonstration that begins where the policy would: play-back without a network (control d).
    Nearest(Arc<Library>),
    /// Recorded targets.
    Replay {
        /// States at the beginning and after each tick.
        targets: Vec<JointState>,
        /// The tick at which the lift began, if it did.
        lift_tick: Option<usize>,
        /// The tick at which the hold began, if it did.
        hold_tick: Option<usize>,
    },
}

impl Controller {
    /// Whether a network acts.
    fn is_of_model(&self) -> bool {
        matches!(self, Self::Policy | Self::ShuffledLatent | Self::ZeroLatent)
    }

    /// Whether the motion was planned before the attempt, its way to where it begins included.
    fn is_planned(&self) -> bool {
        matches!(self, Self::Planner | Self::Found(_) | Self::Demonstration(_) | Self::Nearest(_))
    }

    /// Whether it was planned for this very object and pose, and its way kept off them.
    fn knows_the_place(&self) -> bool {
        self.is_planned() && !matches!(self, Self::Nearest(_))
    }
}

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

/// An attempt in progress.
pub struct Attempt {
    pub(crate) scene: Scene,
    object: Object,
    name: String,
    pose: [f32; 3],
    seed: u64,
    controller: Controller,
    cloud: Vec<Vec3>,
    pub(crate) encoding: Option<Encoding>,
    pub(crate) state: JointState,
    plan: std::vec::IntoIter<JointState>,
    pub(crate) phase: Phase,
    phase_ticks: usize,
    resting_ticks: usize,
    approach_ticks: usize,
    lift_tick: Option<usize>,
    hold_tick: Option<usize>,
    hold: Option<Hold>,
    story: Story,
    verdict: Option<Verdict>,
    /// The world's hash at the verdict.
    end: Option<String>,
    pub(crate) is_pulled: bool,
    pub(crate) was_pulled: bool,
    targets: Vec<Vec<f64>>,
}

/// Distance (m) by which the approach may move the object.
const APPROACH_SHIFT: f32 = 0.01;

/// Where an attempt puts the object if it is not told: x, y (m), yaw (rad).
pub fn pose_of_seed(robot: &Robot, seed: u64) -> [f32; 3] {
    drawn_pose(robot, seed).0
}

/// The pose is the first thing that an attempt draws; the rest follows from the same generator.
fn drawn_pose(robot: &Robot, seed: u64) -> ([f32; 3], ChaCha8Rng) {
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
            lift_tick: None,
            hold_tick: None,
            hold: None,
            story: Story { start: world_from_object.translation, highest: 0.0 },
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
        Ok(attempt)
    }

    /// One control period.
    pub fn tick(&mut self, workcell: &Workcell) {
        if self.phase == Phase::Done {
            return;
        }
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
        let (Some(model), Some(object)) = (&workcell.model, &self.encoding) else {
            return Some(JointState::at_rest(self.state.q));
        };
        let Some(qdd) = object.acceleration(&model.network, &self.state) else {
            self.fail(Failure::NotFinite);
            return None;
        };
        let limits = &workcell.robot.tree.limits;
        let free = integrator::step(&self.state, &qdd, CONTROL_PERIOD);
        let q = limits.clamp(&free.q, 0.0);
        // A joint at its limit stops there.
        let qd = JointVector::from_fn(|i, _| if q[i] == free.q[i] { free.qd[i] } else { 0.0 });
        Some(JointState { q, qd })
    }

    /// Looks at the world after a tick and moves on to the next phase when it is time.
    fn observe(&mut self, workcell: &Workcell) {
        let protocol = &workcell.robot.config.attempt;
        self.story.highest = self.story.highest.max(self.scene.object_height());
        if !self.scene.is_finite() {
            return self.fail(Failure::NotFinite);
        }
        let object = self.scene.object_pose().translation;
        let is_replay = matches!(self.controller, Controller::Replay { .. });
        match self.phase {
            Phase::Approach if is_replay => {
                let Controller::Replay { lift_tick, .. } = self.controller else { return };
                if lift_tick.is_some_and(|tick| self.ticks() >= tick) {
                    self.begin_lift(workcell);
                }
            }
            Phase::Approach => {
                let is_shifted = object.distance(self.story.start) > APPROACH_SHIFT;
                if is_shifted && !self.controller.knows_the_place() {
                    return self.fail(Failure::Collided);
                }
                if self.controller.is_planned() {
                    if self.phase_ticks >= self.approach_ticks {
                        self.enter(Phase::Policy);
                    }
                } else if self.plan.len() == 0 {
                    self.enter(Phase::Policy);
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
    }

    fn begin_lift(&mut self, workcell: &Workcell) {
        self.lift_tick = Some(self.ticks());
        self.hold = Some(Hold::begin(&self.scene));
        self.enter(Phase::Lift);
        if matches!(self.controller, Controller::Replay { .. }) {
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
            let is_up = match self.controller {
                Controller::Replay { hold_tick, .. } => Some(self.ticks()) == hold_tick,
                _ => self.plan.len() == 0,
            };
            if is_up {
                self.hold_tick = Some(self.ticks());
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

    fn fail(&mut self, reason: Failure) {
        self.finish(Verdict::Failed { reason });
    }

    fn finish(&mut self, verdict: Verdict) {
        self.verdict = Some(verdict);
        self.end = Some(self.scene.state_hash().to_hex().to_string());
        self.enter(Phase::Done);
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
        let end = self.lift_tick.unwrap_or(self.ticks());
        let rows = self.targets.get(self.approach_ticks..=end).unwrap_or_default();
        rows.iter().map(|row| state_of_row(row)).collect()
    }

    /// How the controller moved between start and lift, if it came to act.
    pub fn motion(&self) -> Option<Motion> {
        Motion::of(&self.acted())
    }

    /// The present moment.
    pub fn moment(&self, workcell: &Workcell) -> Moment {
        let acts = workcell.model.as_ref().zip(self.encoding.as_ref());
        Moment::of(&self.state, &workcell.robot.tree.limits, acts)
    }

    /// The moments between start and lift, a control period apart; none if the controller did not come to act.
    pub fn course(&self, workcell: &Workcell) -> Vec<Moment> {
        let limits = &workcell.robot.tree.limits;
        let is_acting = self.controller.is_of_model();
        let acts = workcell.model.as_ref().zip(self.encoding.as_ref()).filter(|_| is_acting);
        self.acted().iter().map(|state| Moment::of(state, limits, acts)).collect()
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
            lift_tick: self.lift_tick,
            hold_tick: self.hold_tick,
            verdict: self.verdict,
            state_hash: self.state_hash(),
        }
    }
}
