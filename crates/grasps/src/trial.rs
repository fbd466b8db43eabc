//! The trial of a grasp in physics: close, squeeze, lift, hold.

use crate::grasp::{Posture, object_solids};
use fabrics::planner::{self, PlannerConfig};
use fabrics::terms::repulsion::Obstacle;
use fabrics::{Fabric, FabricConfig, Goal};
use geometry::Pose;
use geometry::object::Object;
use robot::{ARM, DOF, JointState, JointVector, Tree};
use scene::config::CONTROL_PERIOD;
use scene::{Hold, Loss, Scene, SceneConfig, SceneError};

/// What became of a trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrialOutcome {
    /// Held to the end; the greatest slip in the palm (m).
    Lifted {
        /// Greatest slip (m).
        slip: f32,
    },
    /// Not held.
    Lost(Loss),
    /// Physics left the finite numbers.
    NotFinite,
}

/// Ticks of a segment that lasts `seconds`.
fn ticks(seconds: f64) -> usize {
    (seconds / CONTROL_PERIOD).round() as usize
}

/// States from `from` at rest to `to` at rest in an even number of `count` ticks: constant
/// acceleration, then constant deceleration (Eq. 6, 7 hold in every row).
pub fn straight(from: &JointVector, to: &JointVector, count: usize) -> Vec<JointVector> {
    let half = (count / 2).max(1);
    let size = (half * half) as f64 * CONTROL_PERIOD * CONTROL_PERIOD;
    let qdd = (to - from) / size;
    let mut rows = vec![qdd; half];
    rows.extend(std::iter::repeat_n(-qdd, half));
    rows
}

/// Hold (s) of a search's trials and of replays, shorter than the protocol's: what slips at all slips
/// within the first half second.
pub const HOLD_SECONDS: f64 = 0.5;

/// Tries a grasp in the full scene: fingers close in 16 rows and squeeze in 10, hold for 0.3 s, the
/// arm lifts by fabric and holds. `hold_seconds` may be shorter than the protocol's.
pub fn try_grasp(
    config: &SceneConfig,
    tree: &Tree,
    object: &Object,
    world_from_object: &Pose,
    posture: &Posture,
    hold_seconds: f64,
) -> Result<TrialOutcome, SceneError> {
    let mut scene = Scene::new(config, tree, object, world_from_object, &posture.open)?;
    let mut state = JointState::at_rest(posture.open);
    let follow = |scene: &mut Scene, state: &mut JointState, rows: &[JointVector]| {
        for qdd in rows {
            let next = robot::integrator::step(state, qdd, CONTROL_PERIOD);
            scene.follow(state, &next);
            *state = next;
        }
    };
    follow(&mut scene, &mut state, &straight(&posture.open, &posture.touch, 16));
    follow(&mut scene, &mut state, &straight(&posture.touch, &posture.squeeze, 10));
    state = JointState::at_rest(posture.squeeze);
    follow(&mut scene, &mut state, &vec![JointVector::zeros(); ticks(0.3)]);
    lift_and_hold(config, tree, &mut scene, &state, hold_seconds)
}

/// Lifts what the hand holds by fabric, fingers kept as commanded, and judges it while it is held.
pub fn lift_and_hold(
    config: &SceneConfig,
    tree: &Tree,
    scene: &mut Scene,
    state: &JointState,
    hold_seconds: f64,
) -> Result<TrialOutcome, SceneError> {
    let mut hold = Hold::begin(scene);
    let Some(plan) = plan_lift(config, tree, state)? else { return Ok(TrialOutcome::NotFinite) };
    for pair in plan.windows(2) {
        scene.follow(&pair[0], &pair[1]);
        hold.observe(scene);
        if hold.slip > 3.0 * config.attempt.held_distance {
            return Ok(TrialOutcome::Lost(Loss::Slipped));
        }
    }
    let top = plan[plan.len() - 1];
    for _ in 0..ticks(hold_seconds) {
        scene.follow(&top, &top);
        hold.observe(scene);
        if let Some(loss) = hold.loss(scene, &config.attempt) {
            return Ok(TrialOutcome::Lost(loss));
        }
    }
    if !scene.is_finite() {
        return Ok(TrialOutcome::NotFinite);
    }
    Ok(TrialOutcome::Lifted { slip: hold.slip })
}

/// The lift: a fabric pulls the palm straight up by the protocol's height for three seconds at most,
/// and comes as far as the arm reaches; the last state is at rest. `None` if it is not finite.
pub fn plan_lift(
    config: &SceneConfig,
    tree: &Tree,
    state: &JointState,
) -> Result<Option<Vec<JointState>>, SceneError> {
    let obstacle = Obstacle { solids: vec![crate::grasp::table_solid(config)], first_body: 3 };
    let fabric = Fabric::new(tree, state.q, vec![obstacle], FabricConfig::gentle())?;
    let mut palm = tree.kinematics(&state.q).palm();
    palm.translation.vector.z += config.attempt.lift_height;
    let goal = Goal { palm, hand: robot::hand_of(&state.q) };
    let planner =
        PlannerConfig { seconds: 3.0, rest_speed: 0.03, ..PlannerConfig::demonstration() };
    let start = JointState::at_rest(state.q);
    let Some(plan) = planner::flow(&fabric, &start, &goal, &planner) else { return Ok(None) };
    let keep_fingers = |row: &JointState| {
        let fingers = |v: &JointVector, kept: &JointVector| {
            JointVector::from_fn(|i, _| if i < ARM { v[i] } else { kept[i] })
        };
        JointState { q: fingers(&row.q, &state.q), qd: fingers(&row.qd, &JointVector::zeros()) }
    };
    let mut rows: Vec<JointState> = plan.states.iter().map(keep_fingers).collect();
    rows.push(JointState::at_rest(rows[rows.len() - 1].q));
    Ok(Some(rows))
}

/// Least gap (m) of the robot in `q` from the table and from the object.
pub fn clearance(
    config: &SceneConfig,
    tree: &Tree,
    robot: &robot::solids::RobotSolids,
    object: &Object,
    world_from_object: &Pose,
    q: &JointVector,
) -> f32 {
    let mut solids = object_solids(object, world_from_object);
    solids.push(crate::grasp::table_solid(config));
    let kinematics = tree.kinematics(q);
    (3..=DOF).map(|body| robot.gap(&kinematics, body, &solids, 0.05)).fold(0.05, f32::min)
}
