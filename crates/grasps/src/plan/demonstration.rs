//! Demonstrations: fabric motions out of a grasp, reversed, followed by closing and hold (paper §II-A).

use crate::plan::retreat::plan_retreat;
use crate::search::trial::{self, GraspMotion, TrialOutcome, TrialProtocol};
use crate::{PlacedObject, Posture, RobotContext};
use fabrics::planner::Plan;
use geometry::{Pose, Vec3};
use rand::{Rng, RngExt};
use robot::{Isometry, JointState, JointVector, Vector, integrator, rotation, spline};
use scene::SceneError;
use scene::config::CONTROL_DT;

/// A motion into a grasp: from above the object through the grasp posture to the squeeze posture, then a
/// hold.
#[derive(Clone, Debug)]
pub struct Demonstration {
    /// States, one per control period; the first one is nearly at rest.
    pub states: Vec<JointState>,
    /// Joint accelerations (rad/s²): `accelerations[i]` leads from `states[i]` to `states[i + 1]` (Eq. 6, 7).
    pub accelerations: Vec<JointVector>,
    /// Index of the state at which the fingers touch the object.
    pub contact_row: usize,
    /// Minimum distance (m) of the robot's collision shapes from object and table up to `contact_row`, capped
    /// at [`MAX_CLEARANCE`].
    pub clearance: f32,
    /// Number of restarts after the fabric stopped in a local minimum.
    pub num_restarts: usize,
    /// Error of the first state's palm from the sampled pregrasp pose.
    pub goal_error: GoalError,
}

/// Pose error of the palm at the end of a motion, relative to its goal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GoalError {
    /// Position error (m).
    pub distance: f64,
    /// Rotation angle (rad) between the two orientations.
    pub angle: f64,
}

impl GoalError {
    fn between(palm: &Isometry, target: &Isometry) -> Self {
        Self {
            distance: (palm.translation.vector - target.translation.vector).norm(),
            angle: rotation::angle_between(&palm.rotation, &target.rotation),
        }
    }

    /// Whether the goal counts as reached: within 3 cm and 0.2 rad. Near the table, a fabric settles where
    /// the attraction of the goal and the repulsion of the elbow balance.
    pub fn is_reached(&self) -> bool {
        self.distance < 0.03 && self.angle < 0.2
    }
}

/// Distances (m) are computed up to this value.
pub const MAX_CLEARANCE: f32 = 0.05;

/// Parameters of the motion out of a grasp and of its end.
#[derive(Clone, Debug)]
pub struct TrajectoryConfig {
    /// Distance (m) of all fingertips from the object at which the palm starts to retreat.
    pub release_clearance: f32,
    /// Distance (m) of the goal behind the grasp, along the palm's normal, that the palm retreats towards.
    pub retreat_distance: f64,
    /// Minimum distance (m) between the palm positions at the start and at the grasp.
    pub min_distance: f64,
    /// Maximum penetration (m) before `contact_row`.
    pub max_penetration: f32,
    /// Minimum clearance (m) along the spline from the home posture to the first state.
    pub approach_clearance: f32,
    /// Rows from the grasp posture to the squeeze posture: a third of a second.
    pub closing_rows: usize,
    /// Rows of the hold: 0.5 s.
    pub hold_rows: usize,
    /// Joint speed (rad/s, norm) below which the far end is trimmed.
    pub rest_speed: f64,
    /// Maximum joint speed (rad/s, norm) of an oscillation that is accepted as the end of a motion.
    pub oscillation_speed: f64,
    /// Maximum number of restarts; each uses another nominal posture of the fabric.
    pub max_restarts: usize,
}

impl TrajectoryConfig {
    /// Our values; the paper does not give them.
    pub fn standard() -> Self {
        Self {
            release_clearance: 0.02,
            retreat_distance: 0.08,
            min_distance: 0.08,
            max_penetration: 0.001,
            approach_clearance: 0.015,
            closing_rows: 10,
            hold_rows: 15,
            rest_speed: 0.1,
            oscillation_speed: 0.3,
            max_restarts: 3,
        }
    }
}

/// Why a motion is not usable as a demonstration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PlanFailure {
    /// The fabric's state is not finite, exceeds the joint limits or does not settle.
    NotConverged,
    /// The motion ends too close to the grasp.
    TooShort,
    /// The motion penetrates object or table, or the spline from the home posture comes too close to them.
    Collision,
}

/// Samples a palm pose above the object, in the scene's pregrasp region (paper Fig. 2).
///
/// The orientation is that of `palm`, tilted by a small random angle. The region scales with the object's
/// `bounds` and contains the midpoint between fingertips and thumb.
pub fn sample_pregrasp_pose(
    robot: &RobotContext,
    bounds: &[Vec3; 2],
    world_from_object: &Pose,
    palm: &Isometry,
    rng: &mut impl Rng,
) -> Isometry {
    let region = &robot.config.pregrasp_region;
    let [min, max] = bounds.map(rotation::to_vector);
    let half = (max - min) * 0.5;
    let mut draw = |reach: f64| rng.random_range(-reach..=reach);
    let offset =
        Vector::new(draw(region.lateral[0]) * half.x, draw(region.lateral[1]) * half.y, 0.0);
    let tilt = region.tilt_deg.to_radians();
    let (axis, angle) = (Vector::new(draw(1.0), draw(1.0), draw(1.0)), draw(tilt));
    let above = rng.random_range(region.height[0]..=region.height[1]);
    let point = rotation::to_isometry(world_from_object)
        .transform_point(&(offset + Vector::new(0.0, 0.0, max.z + above)).into())
        .coords;
    let turn = rotation::from_axis_angle(&(axis / axis.norm().max(1e-9)), angle) * palm.rotation;
    let grasp_center = Vector::from(robot.tree.hand.grasp.center);
    Isometry::from_parts((point - turn * grasp_center).into(), turn)
}

/// Plans a motion out of the grasp to `target` and reverses it.
///
/// A fabric can stop in a local minimum. The plan then restarts with a nominal posture closer to the robot's.
/// A target beyond the arm's reach is accepted as far as the arm comes: a policy must also grasp from there.
pub fn demonstrate(
    placed: &PlacedObject,
    posture: &Posture,
    target: &Isometry,
    config: &TrajectoryConfig,
) -> Result<Demonstration, PlanFailure> {
    let plan = |restart: usize| {
        let fraction = restart as f64 / config.max_restarts.max(1) as f64;
        let robot_nominal = placed.robot.nominal_facing(&placed.world_from_object);
        let nominal = posture.grasp.lerp(&robot_nominal, fraction);
        let retreat = plan_retreat(placed, posture, &nominal, target, config)?;
        let mut found = finish_demonstration(placed, posture, &retreat, config)?;
        found.num_restarts = restart;
        let palm = placed.robot.tree.forward_kinematics(&retreat.last().q).palm_pose();
        found.goal_error = GoalError::between(&palm, target);
        Ok(found)
    };
    let first = plan(0);
    (1..=config.max_restarts).fold(first, |found, restart| found.or_else(|_| plan(restart)))
}

/// Checks length and clearance of the motion out of the grasp, reverses it, and appends closing and hold.
fn finish_demonstration(
    placed: &PlacedObject,
    posture: &Posture,
    retreat: &Plan,
    config: &TrajectoryConfig,
) -> Result<Demonstration, PlanFailure> {
    let tree = &placed.robot.tree;
    let palm =
        |state: &JointState| tree.forward_kinematics(&state.q).palm_pose().translation.vector;
    if (palm(retreat.last()) - palm(&retreat.states[0])).norm() < config.min_distance {
        return Err(PlanFailure::TooShort);
    }
    let clearance = retreat
        .states
        .iter()
        .fold(MAX_CLEARANCE, |min, state| placed.clearance(&state.q, min).min(min));
    if clearance < -config.max_penetration {
        return Err(PlanFailure::Collision);
    }
    let mut demonstration = reverse(retreat, config.rest_speed);
    demonstration.clearance = clearance;
    // A policy also starts here, and an arm that brushes the object on its way displaces it.
    let (home, start) = (placed.robot.config.home(), demonstration.states[0].q);
    let approach = spline::quintic(&home, &start, &tree.limits, CONTROL_DT);
    let is_free = |state: &JointState| {
        placed.clearance(&state.q, config.approach_clearance) >= config.approach_clearance
    };
    if !approach.iter().step_by(2).all(is_free) {
        return Err(PlanFailure::Collision);
    }
    let rest = [JointVector::zeros()];
    let closing = trial::rest_to_rest(&posture.grasp, &posture.squeeze, config.closing_rows);
    for qdd in closing.iter().chain(rest.iter().cycle().take(config.hold_rows)) {
        let last = demonstration.states[demonstration.states.len() - 1];
        demonstration.states.push(integrator::step(&last, qdd, CONTROL_DT));
        demonstration.accelerations.push(*qdd);
    }
    Ok(demonstration)
}

/// Reverses a motion: q_i = q_f[n-i], q̇_i = -q̇_f[n-i], q̈_i = q̈_f[n-i-1]. Slow rows at the new start are
/// trimmed.
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
        contact_row: n - first,
        clearance: 0.0,
        num_restarts: 0,
        goal_error: GoalError::default(),
    }
}

/// Rows before `contact_row` at which a replay starts. Until then the hand moves freely, and physics follows
/// the commands to a fraction of a degree.
const REPLAY_LEAD_ROWS: usize = 12;

impl Demonstration {
    /// Replays the end of the demonstration in physics, executes `lift`, and returns the outcome.
    pub fn replay(
        &self,
        placed: &PlacedObject,
        lift: &[JointState],
        protocol: TrialProtocol,
    ) -> Result<TrialOutcome, SceneError> {
        let states = &self.states[self.contact_row.saturating_sub(REPLAY_LEAD_ROWS)..];
        GraspMotion { states, lift }.simulate(placed, protocol)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RobotContext;
    use crate::set::catalog::catalog_grasps;
    use objects::object::Object;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn spline_from_home_to_demonstration_start_is_collision_free() {
        let robot = RobotContext::standard().unwrap();
        let object = Object::from_catalog("bleach").unwrap();
        let placed = PlacedObject::new(&robot, &object, &robot.config.object_pose(0.5, 0.1, 0.4));
        let grasps = catalog_grasps("bleach").unwrap().grasps;
        let (_, posture) = placed.reachable(&grasps).next().unwrap();
        let palm = robot.tree.forward_kinematics(&posture.grasp).palm_pose();
        let pose = &placed.world_from_object;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let target = sample_pregrasp_pose(&robot, &object.bounds, pose, &palm, &mut rng);

        let config = TrajectoryConfig::standard();
        let found = demonstrate(&placed, &posture, &target, &config).unwrap();
        let (home, start) = (robot.config.home(), found.states[0].q);
        let approach = spline::quintic(&home, &start, &robot.tree.limits, CONTROL_DT);
        let gaps = approach.iter().map(|state| placed.clearance(&state.q, 0.2));
        let min = gaps.fold(0.2, f32::min);
        assert!(min > config.approach_clearance - 0.002, "{min}");

        let stricter =
            TrajectoryConfig { approach_clearance: min + 0.01, max_restarts: 0, ..config };
        let rejected = demonstrate(&placed, &posture, &target, &stricter);
        assert_eq!(rejected.err(), Some(PlanFailure::Collision));
    }

    #[test]
    fn reversed_motion_satisfies_eq6_and_eq7() {
        let mut plan = Plan::at_rest(JointState::at_rest(JointVector::from_element(0.2)));
        for k in 0..20 {
            let qdd = JointVector::from_fn(|i, _| libm::sin((k * 3 + i) as f64) * 4.0);
            plan.push(qdd, CONTROL_DT);
        }
        let back = reverse(&plan, 0.0);
        assert_eq!(back.states.len(), 21);
        for (i, qdd) in back.accelerations.iter().enumerate() {
            let next = integrator::step(&back.states[i], qdd, CONTROL_DT);
            let error =
                (next.q - back.states[i + 1].q).amax() + (next.qd - back.states[i + 1].qd).amax();
            assert!(error < 1e-12, "row {i} is off by {error}");
        }
        assert_eq!(back.states[20].qd.norm(), 0.0);
    }
}
