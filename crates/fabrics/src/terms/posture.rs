//! Joint-space terms: the rest posture as a geometric term, the hand goal as a forcing term.

use super::{TermSums, attractor::Attractor};
use nalgebra::{SMatrix, SVector};
use robot::{ARM_DOF, DOF, HAND_DOF, JointState, JointVector};

/// Adds the attraction to the rest posture, scaled by |q̇|², so that it bends paths and vanishes at rest.
pub fn add_rest_posture(
    sums: &mut TermSums,
    state: &JointState,
    rest: &JointVector,
    attractor: &Attractor,
) {
    let acceleration =
        attractor.potential_acceleration(&(state.q - rest)) * state.qd.norm_squared();
    let metric = SMatrix::<f64, DOF, DOF>::identity() * attractor.mass;
    sums.geometry.metric += metric;
    sums.geometry.force -= metric * acceleration;
}

/// Adds the attraction of the hand to the posture `target` (rad).
pub fn add_hand_goal(
    sums: &mut TermSums,
    state: &JointState,
    target: &[f64; HAND_DOF],
    attractor: &Attractor,
) {
    let error = SVector::<f64, HAND_DOF>::from_fn(|i, _| state.q[ARM_DOF + i] - target[i]);
    let velocity = SVector::<f64, HAND_DOF>::from_fn(|i, _| state.qd[ARM_DOF + i]);
    let acceleration = attractor.acceleration(&error, &velocity);
    for i in 0..HAND_DOF {
        sums.geometry.metric[(ARM_DOF + i, ARM_DOF + i)] += attractor.mass;
        sums.potential[ARM_DOF + i] -= attractor.mass * acceleration[i];
    }
}
