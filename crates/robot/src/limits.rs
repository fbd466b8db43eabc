//! What the joints can do: position, velocity, acceleration, torque.

use crate::{JointState, JointVector};

/// Limits per joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Least position (rad).
    pub lower: JointVector,
    /// Greatest position (rad).
    pub upper: JointVector,
    /// Greatest speed (rad/s).
    pub velocity: JointVector,
    /// Greatest torque (N·m).
    pub effort: JointVector,
    /// Greatest acceleration asked of a motion planner (rad/s²).
    pub acceleration: JointVector,
}

impl Limits {
    /// The nearest position within the limits, `margin` (rad) inside them.
    pub fn clamp(&self, q: &JointVector, margin: f64) -> JointVector {
        JointVector::from_fn(|i, _| q[i].clamp(self.lower[i] + margin, self.upper[i] - margin))
    }

    /// The state with every joint that is beyond a limit at rest there.
    pub fn stop(&self, state: &JointState) -> JointState {
        let q = self.clamp(&state.q, 0.0);
        let speed = |i: usize| if q[i] == state.q[i] { state.qd[i] } else { 0.0 };
        JointState { q, qd: JointVector::from_fn(|i, _| speed(i)) }
    }

    /// Whether `q` keeps at least `margin` (rad) to every limit.
    pub fn contains(&self, q: &JointVector, margin: f64) -> bool {
        (0..crate::DOF).all(|i| q[i] >= self.lower[i] + margin && q[i] <= self.upper[i] - margin)
    }

    /// Distance (rad) of the joint that is nearest to a limit from it; negative beyond.
    pub fn margin(&self, q: &JointVector) -> f64 {
        (q - self.lower).min().min((self.upper - q).min())
    }

    /// Scales the whole acceleration down until no joint exceeds its limit; keeps its direction.
    pub fn scale_acceleration(&self, qdd: &JointVector) -> JointVector {
        let excess =
            (0..crate::DOF).map(|i| qdd[i].abs() / self.acceleration[i]).fold(1.0, f64::max);
        qdd / excess
    }

    /// Positions mapped to -1 at the lower and +1 at the upper limit.
    pub fn normalize(&self, q: &JointVector) -> JointVector {
        JointVector::from_fn(|i, _| {
            (2.0 * q[i] - self.upper[i] - self.lower[i]) / (self.upper[i] - self.lower[i])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Tree;

    #[test]
    fn scaling_keeps_direction_and_meets_the_limit() {
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let qdd = JointVector::from_fn(|i, _| 3.0 * i as f64 - 20.0);
        let scaled = limits.scale_acceleration(&qdd);
        assert!((scaled.normalize() - qdd.normalize()).norm() < 1e-12);
        let worst =
            (0..crate::DOF).map(|i| scaled[i].abs() / limits.acceleration[i]).fold(0.0, f64::max);
        assert!((worst - 1.0).abs() < 1e-12, "largest share of a limit {worst}, wanted 1");
    }

    #[test]
    fn a_joint_stops_at_its_limit_and_the_others_go_on() {
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let mut q = (limits.lower + limits.upper) / 2.0;
        (q[2], q[9]) = (limits.upper[2] + 0.1, limits.lower[9] - 0.1);
        let stopped = limits.stop(&JointState { q, qd: JointVector::from_element(0.5) });
        assert_eq!(stopped.q, limits.clamp(&q, 0.0));
        for i in 0..crate::DOF {
            assert_eq!(stopped.qd[i], if [2, 9].contains(&i) { 0.0 } else { 0.5 }, "joint {i}");
        }
    }

    #[test]
    fn normalised_limits_are_plus_and_minus_one() {
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        assert!((limits.normalize(&limits.upper).add_scalar(-1.0)).amax() < 1e-12);
        assert!((limits.normalize(&limits.lower).add_scalar(1.0)).amax() < 1e-12);
        assert!(limits.contains(&limits.clamp(&(limits.upper * 2.0), 0.01), 0.0099));
    }
}
