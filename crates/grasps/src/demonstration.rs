//! Demonstrations: fabric motions out of a grasp, reversed, with a closing segment (paper §II-A).

use crate::grasp::table_solid;
use crate::proposal::GRASP_CENTER;
use crate::trial::{self, Endurance, Motion, Physics, TrialOutcome};
use crate::{Posture, Setting};
use fabrics::planner::{Plan, PlannerConfig};
use fabrics::terms::repulsion::Obstacle;
use fabrics::{Fabric, FabricConfig, Goal};
use geometry::{Pose, Vec3};
use rand::{Rng, RngExt};
use robot::{Isometry, JointState, JointVector, Vector, integrator, rotation, spline};
use scene::SceneError;
use scene::config::{CONTROL_PERIOD, TargetBox};

/// A motion into a grasp: from above the object through `touch` to `squeeze`, then a hold.
#[derive(Clone, Debug)]
pub struct Demonstration {
    /// States, a control period apart; the first one has little speed.
    pub states: Vec<JointState>,
    /// `accelerations[i]` leads from `states[i]` to `states[i + 1]` (Eq. 6, 7).
    pub accelerations: Vec<JointVector>,
    /// Index of the state at which the fingers touch.
    pub touch: usize,
    /// Least gap (m) of the robot's collision shapes from object and table before that, at most
    /// [`MOST_CLEARANCE`].
    pub clearance: f32,
    /// How often the fabric got stuck before.
    pub restarts: usize,
    /// Where it begins, seen from the target.
    pub miss: Miss,
}

/// How far the palm at the far end of a motion is from where it was to be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Miss {
    /// Distance (m).
    pub distance: f64,
    /// Angle (rad).
    pub angle: f64,
}

impl Miss {
    fn between(palm: &Isometry, target: &Isometry) -> Self {
        Self {
            distance: (palm.translation.vector - target.translation.vector).norm(),
            angle: rotation::angle_between(&palm.rotation, &target.rotation),
        }
    }

    /// Whether this counts as arrived: within 3 cm and 0.2 rad. Near the table, a fabric comes to rest where it is
    /// drawn to its goal as much as its elbow is pushed off.
    pub fn is_arrival(&self) -> bool {
        self.distance < 0.03 && self.angle < 0.2
    }
}

/// Gaps (m) beyond this are not told apart.
pub const MOST_CLEARANCE: f32 = 0.05;

/// How demonstrations are made.
#[derive(Clone, Debug)]
pub struct TrajectoryConfig {
    /// Gap (m) of the fingertips at which the palm begins to leave.
    pub clear: f32,
    /// By how much less (rad) the fingers are bent on the way than where a grasp opens.
    pub widen: f64,
    /// Distance (m) that the palm leaves straight back before it turns to its target.
    pub retreat: f64,
    /// Least distance (m) of the start palm from the grasp.
    pub least_distance: f64,
    /// Deepest penetration (m) allowed before `touch`.
    pub penetration: f32,
    /// Least gap (m) of the spline from home to where the motion begins.
    pub berth: f32,
    /// Rows from `touch` to `squeeze`, a third of a second.
    pub closing_rows: usize,
    /// Rows of the hold: 0.5 s.
    pub hold_rows: usize,
    /// Joint speed (rad/s, norm) below which the far end is trimmed.
    pub rest_speed: f64,
    /// Joint speed (rad/s, norm) up to which a motion that does not come to rest counts as trembling.
    pub tremble_speed: f64,
    /// Further attempts of a motion that gets stuck, each with another posture to be drawn to.
    pub restarts: usize,
}

impl TrajectoryConfig {
    /// Our values, where the paper is silent.
    pub fn standard() -> Self {
        Self {
            clear: 0.02,
            widen: 0.3,
            retreat: 0.08,
            least_distance: 0.08,
            penetration: 0.001,
            berth: 0.015,
            closing_rows: 10,
            hold_rows: 15,
            rest_speed: 0.1,
            tremble_speed: 0.3,
            restarts: 3,
        }
    }
}

/// Why a motion is no demonstration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Flaw {
    /// The fabric left the finite numbers or the joint limits, or did not come to rest.
    Planner,
    /// It stopped too close to the grasp.
    Short,
    /// It went through object or table, or what leads to its beginning from the robot's home comes too near them.
    Penetrates,
}

/// A pose of the palm above the object, drawn from the scene's box (paper Fig. 2).
///
/// `palm` gives the orientation, which is tilted a little; the box, as many times the object's `bounds` as
/// the scene says, holds the middle between fingertips and thumb.
pub fn draw_target(
    region: &TargetBox,
    bounds: &[Vec3; 2],
    world_from_object: &Pose,
    palm: &Isometry,
    rng: &mut impl Rng,
) -> Isometry {
    let [min, max] = bounds.map(rotation::to_vector);
    let half = (max - min) * 0.5;
    let mut draw = |reach: f64| rng.random_range(-reach..=reach);
    let offset = Vector::new(draw(region.spread[0]) * half.x, draw(region.spread[1]) * half.y, 0.0);
    let tilt = region.tilt_deg.to_radians();
    let (axis, angle) = (Vector::new(draw(1.0), draw(1.0), draw(1.0)), draw(tilt));
    let above = rng.random_range(region.above[0]..=region.above[1]);
    let point = rotation::to_isometry(world_from_object)
        .transform_point(&(offset + Vector::new(0.0, 0.0, max.z + above)).into())
        .coords;
    let turn = rotation::about(&(axis / axis.norm().max(1e-9)), angle) * palm.rotation;
    Isometry::from_parts((point - turn * Vector::from(GRASP_CENTER)).into(), turn)
}

/// Plans out of the grasp to `target` and reverses.
///
/// A fabric can come to rest in a local minimum. Where it does, it starts again, drawn to a posture
/// that lies nearer to the robot's nominal one. A target that is approached as far as the arm goes is good enough: a
/// policy has to find its way from there, too.
pub fn demonstrate(
    setting: &Setting,
    posture: &Posture,
    target: &Isometry,
    config: &TrajectoryConfig,
) -> Result<Demonstration, Flaw> {
    let attempt = |restart: usize| {
        let share = restart as f64 / config.restarts.max(1) as f64;
        let nominal = setting.robot.nominal_towards(&setting.world_from_object);
        let drawn_to = posture.touch.lerp(&nominal, share);
        let leaving = leave(setting, posture, &drawn_to, target, config)?;
        let mut found = checked(setting, posture, &leaving, config)?;
        found.restarts = restart;
        let palm = setting.robot.tree.kinematics(&leaving.last().q).palm();
        found.miss = Miss::between(&palm, target);
        Ok(found)
    };
    let first = attempt(0);
    (1..=config.restarts).fold(first, |found, restart| found.or_else(|_| attempt(restart)))
}

/// The motion out of the grasp, if it is long and touches nothing, reversed and with its end.
fn checked(
    setting: &Setting,
    posture: &Posture,
    leaving: &Plan,
    config: &TrajectoryConfig,
) -> Result<Demonstration, Flaw> {
    let tree = &setting.robot.tree;
    let palm = |state: &JointState| tree.kinematics(&state.q).palm().translation.vector;
    if (palm(leaving.last()) - palm(&leaving.states[0])).norm() < config.least_distance {
        return Err(Flaw::Short);
    }
    let clearance = leaving
        .states
        .iter()
        .fold(MOST_CLEARANCE, |least, state| setting.clearance(&state.q, least).min(least));
    if clearance < -config.penetration {
        return Err(Flaw::Penetrates);
    }
    let mut demonstration = reverse(leaving, config.rest_speed);
    demonstration.clearance = clearance;
    // A policy begins here, too, and what it is led through on its way is pushed aside.
    let (home, begin) = (setting.robot.config.home(), demonstration.states[0].q);
    let approach = spline::quintic(&home, &begin, &tree.limits, CONTROL_PERIOD);
    let is_free = |state: &JointState| setting.clearance(&state.q, config.berth) >= config.berth;
    if !approach.iter().step_by(2).all(is_free) {
        return Err(Flaw::Penetrates);
    }
    let rest = [JointVector::zeros()];
    let closing = trial::straight(&posture.touch, &posture.squeeze, config.closing_rows);
    for qdd in closing.iter().chain(rest.iter().cycle().take(config.hold_rows)) {
        let last = demonstration.states[demonstration.states.len() - 1];
        demonstration.states.push(integrator::step(&last, qdd, CONTROL_PERIOD));
        demonstration.accelerations.push(*qdd);
    }
    Ok(demonstration)
}

/// Where a motion out of a grasp is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The fingers open.
    Open,
    /// The palm goes straight back.
    Retreat,
    /// It goes to its target.
    Leave,
}

/// The motion out of the grasp: fingers open first, then the palm goes straight back, then to its target.
///
/// Reversed, the hand comes wide open and straight at the object: a policy is some 10 mm off on its way, and what it
/// sweeps aside before it closes, it does not grasp.
fn leave(
    setting: &Setting,
    posture: &Posture,
    drawn_to: &JointVector,
    target: &Isometry,
    config: &TrajectoryConfig,
) -> Result<Plan, Flaw> {
    let (tree, solids) = (&setting.robot.tree, &setting.solids);
    let obstacles = vec![
        Obstacle { solids: vec![table_solid(&setting.robot.config)], first_body: 3 },
        Obstacle { solids: solids.clone(), first_body: 3 },
    ];
    let fabric =
        Fabric::new(tree, *drawn_to, obstacles, FabricConfig::calm()).map_err(|_| Flaw::Planner)?;
    let hand = wide_open(&robot::hand_of(&posture.open), config.widen);
    let grasp_palm = tree.kinematics(&posture.touch).palm();
    let back = grasp_palm * Isometry::translation(-config.retreat, 0.0, 0.0);
    let planner = PlannerConfig::demonstration();
    let mut plan = Plan::standing(JointState::at_rest(posture.touch));
    let (mut stage, mut since) = (Stage::Open, 0);
    for row in 0..(planner.seconds / planner.dt) as usize {
        let state = *plan.last();
        let kinematics = tree.kinematics(&state.q);
        let reach = 2.0 * config.clear;
        let gap = |body| setting.robot.solids.gap(&kinematics, body, solids, reach);
        let gone = (kinematics.palm().translation.vector - grasp_palm.translation.vector).norm();
        let is_late = row - since >= STAGE_ROWS;
        let next = match stage {
            Stage::Open if is_late || tree.tips.iter().all(|tip| gap(tip.body) >= config.clear) => {
                Stage::Retreat
            }
            Stage::Retreat if is_late || gone >= TURNING * config.retreat => Stage::Leave,
            same => same,
        };
        if next != stage {
            (stage, since) = (next, row);
        }
        let palm = match stage {
            Stage::Open => grasp_palm,
            Stage::Retreat => back,
            Stage::Leave => *target,
        };
        let qdd = fabric.acceleration(&state, &Goal { palm, hand }).ok_or(Flaw::Planner)?;
        plan.push(qdd, planner.dt);
        let state = plan.last();
        if !tree.limits.contains(&state.q, -0.02) {
            return Err(Flaw::Planner);
        }
        if stage == Stage::Leave && row > since + 15 && state.qd.norm() < config.rest_speed {
            return Ok(plan);
        }
    }
    if stage == Stage::Leave { cut_where_slowest(plan, config) } else { Err(Flaw::Planner) }
}

/// Rows after which a motion goes on although the fingers find no room to open further, or the palm none to go back:
/// a second.
const STAGE_ROWS: usize = 30;

/// Share of the way back at which the palm turns to its target.
const TURNING: f64 = 0.8;

/// A hand (rad) whose fingers are bent less; what spreads them and turns the thumb stays.
fn wide_open(hand: &[f64; robot::HAND], widen: f64) -> [f64; robot::HAND] {
    std::array::from_fn(|i| if i % 4 == 0 { hand[i] } else { hand[i] - widen })
}

/// Near a joint limit a fabric can tremble for ever: its motion ends where it is slowest in the last
/// second.
fn cut_where_slowest(mut plan: Plan, config: &TrajectoryConfig) -> Result<Plan, Flaw> {
    let second = (1.0 / CONTROL_PERIOD) as usize;
    let speed = |i: &usize| plan.states[*i].qd.norm();
    let tail = plan.states.len().saturating_sub(second)..plan.states.len();
    let slowest = tail.min_by(|a, b| speed(a).total_cmp(&speed(b))).ok_or(Flaw::Planner)?;
    if speed(&slowest) > config.tremble_speed {
        return Err(Flaw::Planner);
    }
    plan.states.truncate(slowest + 1);
    plan.accelerations.truncate(slowest);
    Ok(plan)
}

/// Reverses a motion: q_i = q_f[n-i], q̇_i = -q̇_f[n-i], q̈_i = q̈_f[n-i-1]; slow rows at what becomes
/// the beginning are left out.
pub fn reverse(forward: &Plan, rest_speed: f64) -> Demonstration {
    let n = forward.accelerations.len();
    let back = |state: &JointState| JointState { q: state.q, qd: -state.qd };
    let states: Vec<JointState> = forward.states.iter().rev().map(back).collect();
    let accelerations: Vec<JointVector> = forward.accelerations.iter().rev().copied().collect();
    let slow = states.iter().take_while(|state| state.qd.norm() < rest_speed).count();
    let first = slow.saturating_sub(1).min(n);
    Demonstration {
        states: states[first..].to_vec(),
        accelerations: accelerations[first..].to_vec(),
        touch: n - first,
        clearance: 0.0,
        restarts: 0,
        miss: Miss::default(),
    }
}

/// Rows before `touch` at which a replay sets in: until then the hand moves freely, and physics
/// follows the commands to a fraction of a degree.
const LEAD_ROWS: usize = 12;

impl Demonstration {
    /// Plays its end back in physics, goes along `lift`, and says what became of the object.
    pub fn replay(
        &self,
        physics: Physics,
        setting: &Setting,
        lift: &[JointState],
        endurance: Endurance,
    ) -> Result<TrialOutcome, SceneError> {
        let states = &self.states[self.touch.saturating_sub(LEAD_ROWS)..];
        let motion = Motion { states, grasp: self.states[self.touch].q, lift };
        motion.play(physics, setting, endurance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Robot;
    use crate::built_in::built_in;
    use geometry::object::Object;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_way_from_home_to_where_it_begins_is_free() {
        let robot = Robot::standard().unwrap();
        let object = Object::built_in("bleach").unwrap();
        let setting = Setting::new(&robot, &object, &robot.config.upright(0.5, 0.1, 0.4));
        let grasps = built_in("bleach").unwrap().grasps;
        let (_, posture) = setting.options(&grasps).next().unwrap();
        let palm = robot.tree.kinematics(&posture.touch).palm();
        let (region, place) = (&robot.config.target, &setting.world_from_object);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let target = draw_target(region, &object.bounds, place, &palm, &mut rng);

        let config = TrajectoryConfig::standard();
        let found = demonstrate(&setting, &posture, &target, &config).unwrap();
        let (home, begin) = (robot.config.home(), found.states[0].q);
        let approach = spline::quintic(&home, &begin, &robot.tree.limits, CONTROL_PERIOD);
        let gaps = approach.iter().map(|state| setting.clearance(&state.q, 0.2));
        let least = gaps.fold(0.2, f32::min);
        assert!(least > config.berth - 0.002, "{least}");

        let wider = TrajectoryConfig { berth: least + 0.01, restarts: 0, ..config };
        let refused = demonstrate(&setting, &posture, &target, &wider);
        assert_eq!(refused.err(), Some(Flaw::Penetrates));
    }

    #[test]
    fn a_reversed_motion_satisfies_eq6_and_eq7() {
        let mut plan = Plan::standing(JointState::at_rest(JointVector::from_element(0.2)));
        for k in 0..20 {
            let qdd = JointVector::from_fn(|i, _| libm::sin((k * 3 + i) as f64) * 4.0);
            plan.push(qdd, CONTROL_PERIOD);
        }
        let back = reverse(&plan, 0.0);
        assert_eq!(back.states.len(), 21);
        for (i, qdd) in back.accelerations.iter().enumerate() {
            let next = integrator::step(&back.states[i], qdd, CONTROL_PERIOD);
            let error =
                (next.q - back.states[i + 1].q).amax() + (next.qd - back.states[i + 1].qd).amax();
            assert!(error < 1e-12, "row {i} is off by {error}");
        }
        assert_eq!(back.states[20].qd.norm(), 0.0);
    }
}
