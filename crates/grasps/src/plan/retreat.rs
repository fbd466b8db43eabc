//! Fabric motion out of a grasp; its reverse is a demonstration (paper §II-A).

use crate::plan::demonstration::{PlanFailure, TrajectoryConfig};
use crate::set::grasp::table_shape;
use crate::{PlacedObject, Posture};
use fabrics::planner::{Plan, PlannerConfig};
use fabrics::terms::repulsion::Obstacle;
use fabrics::{Fabric, FabricConfig, Goal};
use robot::{Isometry, JointState, JointVector};
use scene::config::CONTROL_DT;

/// Phase of a motion out of a grasp.
#[derive(Clone, Copy, PartialEq, Eq)]
enum RetreatPhase {
    /// The fingers open.
    Open,
    /// The palm moves back along its normal.
    Retreat,
    /// The palm moves to the pregrasp pose.
    MoveToPregrasp,
}

/// Plans the motion out of the grasp: the fingers open, the palm retreats along its normal, then moves to
/// `target`.
///
/// Reversed, the hand approaches wide open and along the palm's normal. A policy is about 10 mm off its path,
/// and an object that the hand displaces before it closes is not grasped.
pub(super) fn plan_retreat(
    placed: &PlacedObject,
    posture: &Posture,
    nominal: &JointVector,
    target: &Isometry,
    config: &TrajectoryConfig,
) -> Result<Plan, PlanFailure> {
    let (tree, solids) = (&placed.robot.tree, &placed.shapes);
    let first_active_body = tree.hand.avoidance.first_body;
    let obstacles = vec![
        Obstacle { shapes: vec![table_shape(&placed.robot.config)], first_active_body },
        Obstacle { shapes: solids.clone(), first_active_body },
    ];
    let fabric = Fabric::new(tree, *nominal, obstacles, FabricConfig::demonstration())
        .map_err(|_| PlanFailure::NotConverged)?;
    let hand = open_wider(&robot::hand_joints(&posture.pregrasp), tree.hand.opening.demonstration);
    let grasp_palm = tree.forward_kinematics(&posture.grasp).palm_pose();
    let back = grasp_palm * Isometry::translation(-config.retreat_distance, 0.0, 0.0);
    let planner = PlannerConfig::demonstration();
    let mut plan = Plan::at_rest(JointState::at_rest(posture.grasp));
    let (mut stage, mut since) = (RetreatPhase::Open, 0);
    for row in 0..(planner.max_seconds / planner.dt) as usize {
        let state = *plan.last();
        let kinematics = tree.forward_kinematics(&state.q);
        let reach = 2.0 * config.release_clearance;
        let gap =
            |body| placed.robot.collision_model.body_distance(&kinematics, body, solids, reach);
        let distance =
            (kinematics.palm_pose().translation.vector - grasp_palm.translation.vector).norm();
        let is_late = row - since >= MAX_PHASE_ROWS;
        let next = match stage {
            RetreatPhase::Open
                if is_late
                    || tree
                        .fingertips
                        .iter()
                        .all(|tip| gap(tip.body) >= config.release_clearance) =>
            {
                RetreatPhase::Retreat
            }
            RetreatPhase::Retreat
                if is_late || distance >= TURN_FRACTION * config.retreat_distance =>
            {
                RetreatPhase::MoveToPregrasp
            }
            same => same,
        };
        if next != stage {
            (stage, since) = (next, row);
        }
        let palm = match stage {
            RetreatPhase::Open => grasp_palm,
            RetreatPhase::Retreat => back,
            RetreatPhase::MoveToPregrasp => *target,
        };
        let qdd =
            fabric.acceleration(&state, &Goal { palm, hand }).ok_or(PlanFailure::NotConverged)?;
        plan.push(qdd, planner.dt);
        let state = plan.last();
        if !tree.limits.contains(&state.q, -0.02) {
            return Err(PlanFailure::NotConverged);
        }
        if stage == RetreatPhase::MoveToPregrasp
            && row > since + 15
            && state.qd.norm() < config.rest_speed
        {
            return Ok(plan);
        }
    }
    if stage == RetreatPhase::MoveToPregrasp {
        trim_tail(plan, config)
    } else {
        Err(PlanFailure::NotConverged)
    }
}

/// Maximum rows (1 s) of opening or retreating; after these, the next phase starts although fingers or palm
/// are blocked.
const MAX_PHASE_ROWS: usize = 30;

/// Fraction of the retreat distance after which the palm turns to its target.
const TURN_FRACTION: f64 = 0.8;

/// Opens the flexing joints (rad) of each finger by `widen`; abduction and thumb rotation are unchanged.
fn open_wider(hand: &[f64; robot::HAND_DOF], widen: f64) -> [f64; robot::HAND_DOF] {
    std::array::from_fn(|i| if robot::is_flexion_joint(i) { hand[i] - widen } else { hand[i] })
}

/// Trims a motion that oscillates near a joint limit: it ends at its slowest state of the last second.
fn trim_tail(mut plan: Plan, config: &TrajectoryConfig) -> Result<Plan, PlanFailure> {
    let second = (1.0 / CONTROL_DT) as usize;
    let speed = |i: &usize| plan.states[*i].qd.norm();
    let tail = plan.states.len().saturating_sub(second)..plan.states.len();
    let slowest =
        tail.min_by(|a, b| speed(a).total_cmp(&speed(b))).ok_or(PlanFailure::NotConverged)?;
    if speed(&slowest) > config.oscillation_speed {
        return Err(PlanFailure::NotConverged);
    }
    plan.states.truncate(slowest + 1);
    plan.accelerations.truncate(slowest);
    Ok(plan)
}
