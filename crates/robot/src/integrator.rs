//! The integrator that policy, expert and planner share (Eq. 6 and 7).

use crate::{JointState, JointVector};

/// One step of `dt` (s) under constant acceleration: q + dt q̇ + ½ dt² q̈ (Eq. 6), q̇ + dt q̈ (Eq. 7).
pub fn step(state: &JointState, qdd: &JointVector, dt: f64) -> JointState {
    JointState { q: state.q + state.qd * dt + qdd * (0.5 * dt * dt), qd: state.qd + qdd * dt }
}

/// Root mean square of the jerk (rad/s³, norm over all joints) of accelerations that are `dt` (s) apart; 0 of fewer than
/// two.
pub fn jerk(accelerations: &[JointVector], dt: f64) -> f64 {
    let pairs = accelerations.windows(2);
    let sum: f64 = pairs.clone().map(|pair| (pair[1] - pair[0]).norm_squared()).sum();
    libm::sqrt(sum / pairs.len().max(1) as f64) / dt
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DOF;

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

    #[test]
    fn a_steady_push_has_no_jerk_and_a_swaying_one_has() {
        let sways = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let accelerations = |push: &dyn Fn(usize) -> f64| -> Vec<JointVector> {
            (0..4).map(|i| JointVector::from_element(push(i))).collect()
        };
        assert_eq!(jerk(&accelerations(&|_| 1.0), 0.1), 0.0);
        assert_eq!(jerk(&accelerations(&sways)[..1], 0.1), 0.0);
        let wanted = 2.0 * libm::sqrt(DOF as f64) / 0.1;
        let found = jerk(&accelerations(&sways), 0.1);
        assert!((found - wanted).abs() < 1e-9, "{found}, wanted {wanted}");
    }
}
