//! Joint targets of a file: rows of q (rad), then q̇ (rad/s), shape (2 DOF), and their checks.

use crate::rollout_context::{RolloutContext, RolloutError};
use robot::{DOF, JointState, JointVector};

/// Tolerance (rad) of the joint limits.
const LIMIT_TOLERANCE: f64 = 0.1;

/// Converts a state to a row of joint targets.
pub(super) fn to_row(state: &JointState) -> Vec<f64> {
    state.q.iter().chain(state.qd.iter()).copied().collect()
}

/// Converts rows of joint targets to states.
pub(super) fn parse_states(rows: &[Vec<f64>]) -> Result<Vec<JointState>, RolloutError> {
    rows.iter().enumerate().map(|(row, values)| parse_row(row, values)).collect()
}

fn parse_row(row: usize, values: &[f64]) -> Result<JointState, RolloutError> {
    let (found, wanted) = (values.len(), 2 * DOF);
    if found != wanted {
        return Err(RolloutError::RowLength { row, found, wanted });
    }
    let (q, qd) = values.split_at(DOF);
    Ok(JointState { q: JointVector::from_column_slice(q), qd: JointVector::from_column_slice(qd) })
}

/// Returns an error if a state exceeds the joint limits by more than 0.1 rad or the speed `max_speed`
/// (rad/s).
pub(super) fn check_states(
    context: &RolloutContext,
    states: &[JointState],
    max_speed: f64,
) -> Result<(), RolloutError> {
    let limits = &context.robot.tree.limits;
    let is_possible = |state: &JointState| {
        limits.contains(&state.q, -LIMIT_TOLERANCE)
            && state.qd.amax() < max_speed
            && state.qd.norm().is_finite()
    };
    match states.iter().position(|state| !is_possible(state)) {
        Some(row) => Err(RolloutError::BeyondLimits { row }),
        None => Ok(()),
    }
}
