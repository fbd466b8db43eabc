//! Lift: a fabric moves the palm straight up while the finger joints stay fixed.

use crate::set::grasp::table_shape;
use crate::{PlacedObject, Posture, RobotContext};
use fabrics::planner::{self, PlannerConfig};
use fabrics::terms::repulsion::Obstacle;
use fabrics::{Fabric, FabricConfig, Goal};
use robot::{ARM_DOF, JointState, JointVector, KinematicTree};
use scene::{SceneConfig, SceneError};

/// Plans a lift: a fabric moves the palm straight up by the protocol's height, for up to 3 s.
///
/// The lift ends earlier where the arm cannot reach higher; the last state is at rest. `None` if the plan is
/// not finite.
pub fn plan(
    config: &SceneConfig,
    tree: &KinematicTree,
    state: &JointState,
) -> Result<Option<Vec<JointState>>, SceneError> {
    let first_active_body = tree.hand.avoidance.first_body;
    let obstacle = Obstacle { shapes: vec![table_shape(config)], first_active_body };
    let fabric = Fabric::new(tree, state.q, vec![obstacle], FabricConfig::lifting())?;
    let mut palm = tree.forward_kinematics(&state.q).palm_pose();
    palm.translation.vector.z += config.protocol.lift_height;
    let goal = Goal { palm, hand: robot::hand_joints(&state.q) };
    let planner =
        PlannerConfig { max_seconds: 3.0, rest_speed: 0.06, ..PlannerConfig::demonstration() };
    let start = JointState::at_rest(state.q);
    let Some(plan) = planner::plan(&fabric, &start, &goal, &planner) else { return Ok(None) };
    let hold_fingers = |row: &JointState| {
        let fingers = |v: &JointVector, kept: &JointVector| {
            JointVector::from_fn(|i, _| if i < ARM_DOF { v[i] } else { kept[i] })
        };
        JointState { q: fingers(&row.q, &state.q), qd: fingers(&row.qd, &JointVector::zeros()) }
    };
    let mut rows: Vec<JointState> = plan.states.iter().map(hold_fingers).collect();
    rows.push(JointState::at_rest(rows[rows.len() - 1].q));
    Ok(Some(rows))
}

/// The lift that follows a grasp. It is the same for all demonstrations of the grasp, which end in one
/// posture. `None` if the plan is not finite.
pub fn plan_from_grasp(
    placed: &PlacedObject,
    posture: &Posture,
) -> Result<Option<Vec<JointState>>, SceneError> {
    let robot = placed.robot;
    plan(&robot.config, &robot.tree, &JointState::at_rest(posture.squeeze))
}

/// Height (m) by which a lift raises the palm; near the limits of the arm it is below the protocol's height.
pub fn lift_height(robot: &RobotContext, lift: &[JointState]) -> f64 {
    let height =
        |state: &JointState| robot.tree.forward_kinematics(&state.q).palm_pose().translation.z;
    lift.last().zip(lift.first()).map_or(0.0, |(last, first)| height(last) - height(first))
}

/// Margin (m) of a planned lift over the height at which an object counts as held. A policy grasps about 10
/// mm off the planned pose, which can reduce the lift height by that much.
const LIFT_MARGIN: f64 = 0.02;

/// Whether a lift raises the palm far enough for the object to count as held. Close to the robot's base, the
/// height depends on the orientation of the palm.
pub fn reaches_hold_height(robot: &RobotContext, lift: &[JointState]) -> bool {
    lift_height(robot, lift) >= f64::from(robot.config.protocol.min_hold_height) + LIFT_MARGIN
}
