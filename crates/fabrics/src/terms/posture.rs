//! Pulls on the joints themselves: a resting posture as geometry, a hand posture as goal.

use super::{Pull, attractor::Attractor};
use nalgebra::{SMatrix, SVector};
use robot::{ARM, DOF, HAND, JointState, JointVector};

/// Bends paths towards a resting posture: |q̇|² times the attractor's pull, so it vanishes at rest.
pub fn add_resting(pull: &mut Pull, state: &JointState, rest: &JointVector, attractor: &Attractor) {
    let bend = attractor.pull(&(state.q - rest)) * state.qd.norm_squared();
    let metric = SMatrix::<f64, DOF, DOF>::identity() * attractor.mass;
    pull.geometry.metric += metric;
    pull.geometry.force -= metric * bend;
}

/// Drives the hand to a posture.
pub fn add_hand(pull: &mut Pull, state: &JointState, target: &[f64; HAND], attractor: &Attractor) {
    let error = SVector::<f64, HAND>::from_fn(|i, _| state.q[ARM + i] - target[i]);
    let velocity = SVector::<f64, HAND>::from_fn(|i, _| state.qd[ARM + i]);
    let acceleration = attractor.acceleration(&error, &velocity);
    for i in 0..HAND {
        pull.geometry.metric[(ARM + i, ARM + i)] += attractor.mass;
        pull.potential[ARM + i] -= attractor.mass * acceleration[i];
    }
}
