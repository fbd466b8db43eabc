//! Joint limits: position, velocity, acceleration, torque.

use crate::{JointState, JointVector};

/// Limits of each joint.
///
/// ```rust
/// let limits = robot::KinematicTree::iiwa7_allegro()?.limits;
/// // Normalized positions are -1 at the lower limit, 0 in the middle and +1 at the upper limit.
/// let middle = (limits.lower + limits.upper) / 2.0; // rad
/// assert!(limits.normalize(&middle).amax() < 1e-12);
/// // Every upper limit is positive, so twice its value is beyond it.
/// assert_eq!(limits.clamp(&(limits.upper * 2.0), 0.0), limits.upper);
/// # Ok::<(), robot::UrdfError>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct JointLimits {
    /// Min position (rad).
    pub lower: JointVector,
    /// Max position (rad).
    pub upper: JointVector,
    /// Max speed (rad/s).
    pub velocity: JointVector,
    /// Max torque (N·m).
    pub torque: JointVector,
    /// Max acceleration of planned motions (rad/s²).
    pub acceleration: JointVector,
}

impl JointLimits {
    /// Clamps `q` to the limits minus `margin` (rad).
    pub fn clamp(&self, q: &JointVector, margin: f64) -> JointVector {
        JointVector::from_fn(|i, _| q[i].clamp(self.lower[i] + margin, self.upper[i] - margin))
    }

    /// Clamps positions to the limits and sets the velocity of clamped joints to zero.
    pub fn clamp_state(&self, state: &JointState) -> JointState {
        let q = self.clamp(&state.q, 0.0);
        let speed = |i: usize| if q[i] == state.q[i] { state.qd[i] } else { 0.0 };
        JointState { q, qd: JointVector::from_fn(|i, _| speed(i)) }
    }

    /// Whether each joint of `q` is at least `margin` (rad) inside its limits.
    pub fn contains(&self, q: &JointVector, margin: f64) -> bool {
        (0..crate::DOF).all(|i| q[i] >= self.lower[i] + margin && q[i] <= self.upper[i] - margin)
    }

    /// Min distance (rad) of any joint to its nearest limit; negative outside the limits.
    pub fn min_margin(&self, q: &JointVector) -> f64 {
        (q - self.lower).min().min((self.upper - q).min())
    }

    /// Scales the acceleration `qdd` (rad/s²) down until no joint exceeds its limit. The direction is
    /// preserved.
    pub fn scale_acceleration(&self, qdd: &JointVector) -> JointVector {
        let excess =
            (0..crate::DOF).map(|i| qdd[i].abs() / self.acceleration[i]).fold(1.0, f64::max);
        qdd / excess
    }

    /// Maps positions (rad) linearly: -1 at the lower limit, +1 at the upper limit.
    pub fn normalize(&self, q: &JointVector) -> JointVector {
        JointVector::from_fn(|i, _| {
            (2.0 * q[i] - self.upper[i] - self.lower[i]) / (self.upper[i] - self.lower[i])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::KinematicTree;

    #[test]
    fn scaled_acceleration_preserves_direction_and_meets_limit() {
        let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
        let qdd = JointVector::from_fn(|i, _| 3.0 * i as f64 - 20.0);
        let scaled = limits.scale_acceleration(&qdd);
        assert!((scaled.normalize() - qdd.normalize()).norm() < 1e-12);
        let worst =
            (0..crate::DOF).map(|i| scaled[i].abs() / limits.acceleration[i]).fold(0.0, f64::max);
        assert!((worst - 1.0).abs() < 1e-12, "largest fraction of a limit {worst}, wanted 1");
    }

    #[test]
    fn clamp_state_stops_only_joints_beyond_their_limits() {
        let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
        let mut q = (limits.lower + limits.upper) / 2.0;
        (q[2], q[9]) = (limits.upper[2] + 0.1, limits.lower[9] - 0.1);
        let stopped = limits.clamp_state(&JointState { q, qd: JointVector::from_element(0.5) });
        assert_eq!(stopped.q, limits.clamp(&q, 0.0));
        for i in 0..crate::DOF {
            assert_eq!(stopped.qd[i], if [2, 9].contains(&i) { 0.0 } else { 0.5 }, "joint {i}");
        }
    }

    #[test]
    fn normalized_limits_are_plus_and_minus_one() {
        let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
        assert!((limits.normalize(&limits.upper).add_scalar(-1.0)).amax() < 1e-12);
        assert!((limits.normalize(&limits.lower).add_scalar(1.0)).amax() < 1e-12);
        assert!(limits.contains(&limits.clamp(&(limits.upper * 2.0), 0.01), 0.0099));
    }
}
