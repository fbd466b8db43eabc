//! Quintic rest-to-rest splines in joint space (paper §IV): motions between two postures at rest.

use crate::{DOF, JointLimits, JointState, JointVector};

/// Max fraction of the joint velocity limits that a spline uses.
const MAX_SPEED_FRACTION: f64 = 0.5;
/// Min duration (s).
const MIN_DURATION: f64 = 1.0;

/// Samples the spline from `from` to `to` (rad), both at rest, every `dt` (s); `from` is excluded.
///
/// ```rust
/// use robot::{JointVector, spline};
/// let limits = robot::KinematicTree::iiwa7_allegro()?.limits;
/// let (from, to) = (JointVector::zeros(), JointVector::from_element(0.1));
/// // A motion of 0.1 rad has the min duration of 1 s: 4 steps of 0.25 s.
/// let states = spline::quintic(&from, &to, &limits, 0.25);
/// assert_eq!(states.len(), 4);
/// assert_eq!(states[1].q, to * 0.5); // half of the way at half of the time
/// assert_eq!((states[3].q, states[3].qd), (to, JointVector::zeros()));
/// # Ok::<(), robot::UrdfError>(())
/// ```
pub fn quintic(
    from: &JointVector,
    to: &JointVector,
    limits: &JointLimits,
    dt: f64,
) -> Vec<JointState> {
    let distance = to - from;
    // The max speed of the quintic is 15/8 of its mean speed.
    let seconds = (0..DOF)
        .map(|i| 1.875 * distance[i].abs() / (MAX_SPEED_FRACTION * limits.velocity[i]))
        .fold(MIN_DURATION, f64::max);
    let count = libm::ceil(seconds / dt) as usize;
    let seconds = count as f64 * dt;
    (1..=count)
        .map(|i| {
            let s = i as f64 / count as f64;
            let fraction = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
            let rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / seconds;
            JointState { q: from + distance * fraction, qd: distance * rate }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::KinematicTree;

    #[test]
    fn quintic_ends_at_rest_at_goal_within_speed_limits() {
        let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
        let (from, to) = (JointVector::zeros(), JointVector::from_fn(|i, _| 0.1 * i as f64 - 0.5));
        let rows = quintic(&from, &to, &limits, 1.0 / 30.0);
        let last = rows.last().unwrap();
        assert!((last.q - to).amax() < 1e-12 && last.qd.amax() < 1e-12);
        for row in &rows {
            assert!((0..DOF).all(|i| row.qd[i].abs() <= 0.51 * limits.velocity[i]));
        }
    }
}
