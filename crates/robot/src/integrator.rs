//! The integrator that policy, expert and planner share (Eq. 6 and 7).

use crate::{JointState, JointVector};

/// One step of `dt` (s) under constant acceleration: q + dt q̇ + ½ dt² q̈ (Eq. 6), q̇ + dt q̈ (Eq. 7).
pub fn step(state: &JointState, qdd: &JointVector, dt: f64) -> JointState {
    JointState { q: state.q + state.qd * dt + qdd * (0.5 * dt * dt), qd: state.qd + qdd * dt }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq6_eq7_are_exact_under_constant_acceleration() {
        let qdd = JointVector::from_fn(|i, _| 0.1 * i as f64 - 1.0);
        let start = JointState {
            q: JointVector::from_element(0.3),
            qd: JointVector::from_fn(|i, _| 0.05 * i as f64),
        };
        let mut state = start;
        for _ in 0..30 {
            state = step(&state, &qdd, 1.0 / 30.0);
        }
        let q = start.q + start.qd + 0.5 * qdd;
        let qd = start.qd + qdd;
        assert!((state.q - q).amax() < 1e-12, "q off by {}", (state.q - q).amax());
        assert!((state.qd - qd).amax() < 1e-12, "qd off by {}", (state.qd - qd).amax());
    }
}
