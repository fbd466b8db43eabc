//! Time integration shared by policy, expert and planner (Eq. 6 and 7).

use crate::{JointState, JointVector};

/// Control period (s): 30 Hz, as in the paper.
pub const CONTROL_DT: f64 = 1.0 / 30.0;

/// One step of `dt` (s) under constant acceleration: q + dt q̇ + ½ dt² q̈ (Eq. 6), q̇ + dt q̈ (Eq. 7).
///
/// ```rust
/// use robot::{JointState, JointVector, integrator};
/// // From q = 0 rad and q̇ = 1 rad/s, with q̈ = 2 rad/s² for 0.5 s.
/// let start = JointState { q: JointVector::zeros(), qd: JointVector::from_element(1.0) };
/// let next = integrator::step(&start, &JointVector::from_element(2.0), 0.5);
/// assert_eq!(next.q[0], 0.75); // 0.5 · 1 + ½ · 0.5² · 2
/// assert_eq!(next.qd[0], 2.0); // 1 + 0.5 · 2
/// ```
pub fn step(state: &JointState, qdd: &JointVector, dt: f64) -> JointState {
    JointState { q: state.q + state.qd * dt + qdd * (0.5 * dt * dt), qd: state.qd + qdd * dt }
}

/// Root mean square jerk (rad/s³, norm over all joints) of accelerations sampled every `dt` (s); 0 for fewer
/// than two samples.
pub fn rms_jerk(accelerations: &[JointVector], dt: f64) -> f64 {
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
    fn rms_jerk_is_zero_for_constant_and_exact_for_alternating_acceleration() {
        let alternating = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let accelerations = |value: &dyn Fn(usize) -> f64| -> Vec<JointVector> {
            (0..4).map(|i| JointVector::from_element(value(i))).collect()
        };
        assert_eq!(rms_jerk(&accelerations(&|_| 1.0), 0.1), 0.0);
        assert_eq!(rms_jerk(&accelerations(&alternating)[..1], 0.1), 0.0);
        let wanted = 2.0 * libm::sqrt(DOF as f64) / 0.1;
        let found = rms_jerk(&accelerations(&alternating), 0.1);
        assert!((found - wanted).abs() < 1e-9, "{found}, wanted {wanted}");
    }
}
