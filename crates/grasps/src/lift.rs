//! The lift: a fabric pulls the palm straight up, and the fingers stay as they are.

use crate::grasp::table_solid;
use crate::{Posture, Robot, Setting};
use fabrics::planner::{self, PlannerConfig};
use fabrics::terms::repulsion::Obstacle;
use fabrics::{Fabric, FabricConfig, Goal};
use robot::{ARM, JointState, JointVector, Tree};
use scene::{SceneConfig, SceneError};

/// The lift: a fabric pulls the palm straight up by the protocol's height for three seconds at most,
/// and comes as far as the arm reaches; the last state is at rest. `None` if it is not finite.
pub fn plan(
    config: &SceneConfig,
    tree: &Tree,
    state: &JointState,
) -> Result<Option<Vec<JointState>>, SceneError> {
    let obstacle = Obstacle { solids: vec![table_solid(config)], first_body: 3 };
    let fabric = Fabric::new(tree, state.q, vec![obstacle], FabricConfig::gentle())?;
    let mut palm = tree.kinematics(&state.q).palm();
    palm.translation.vector.z += config.attempt.lift_height;
    let goal = Goal { palm, hand: robot::hand_of(&state.q) };
    let planner =
        PlannerConfig { seconds: 3.0, rest_speed: 0.06, ..PlannerConfig::demonstration() };
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

/// The lift after a grasp's demonstrations, the same for all: they end in one posture. `None` if it is not finite.
pub fn plan_after(
    setting: &Setting,
    posture: &Posture,
) -> Result<Option<Vec<JointState>>, SceneError> {
    let robot = setting.robot;
    plan(&robot.config, &robot.tree, &JointState::at_rest(posture.squeeze))
}

/// Height (m) by which a lift raises the palm; near the edge of its reach the arm comes less far than is asked.
pub fn rise(robot: &Robot, lift: &[JointState]) -> f64 {
    let height = |state: &JointState| robot.tree.kinematics(&state.q).palm().translation.z;
    lift.last().zip(lift.first()).map_or(0.0, |(last, first)| height(last) - height(first))
}

/// Height (m) by which a planned lift raises the palm beyond that at which an object counts as held: a policy takes hold
/// some 10 mm beside the place, and lifts as much less.
const RISE_MARGIN: f64 = 0.02;

/// Whether a lift raises the palm so far that the object counts as held: close to its base the arm cannot raise a hand as
/// far as one that it holds another way.
pub fn rises_enough(robot: &Robot, lift: &[JointState]) -> bool {
    rise(robot, lift) >= f64::from(robot.config.attempt.held_height) + RISE_MARGIN
}
