//! Quintic splines in joint space, from rest to rest (paper §IV).

use crate::{DOF, JointState, JointVector, Limits};

/// Share of the joints' velocity limits that a spline uses at most.
const SPEED_SHARE: f64 = 0.5;
/// Shortest duration (s).
const LEAST_SECONDS: f64 = 1.0;

/// States from `from` at rest to `to` at rest (rad), `dt` (s) apart, `from` not included.
pub fn quintic(from: &JointVector, to: &JointVector, limits: &Limits, dt: f64) -> Vec<JointState> {
    let distance = to - from;
    // The quintic's greatest speed is 15/8 of its mean speed.
    let seconds = (0..DOF)
        .map(|i| 1.875 * distance[i].abs() / (SPEED_SHARE * limits.velocity[i]))
        .fold(LEAST_SECONDS, f64::max);
    let count = libm::ceil(seconds / dt) as usize;
    let seconds = count as f64 * dt;
    (1..=count)
        .map(|i| {
            let s = i as f64 / count as f64;
            let share = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
            let rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / seconds;
            JointState { q: from + distance * share, qd: distance * rate }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Tree;

    #[test]
    fn it_ends_at_rest_at_the_goal_within_the_speed_limits() {
        let limits = Tree::iiwa7_allegro().unwrap().limits;
        let (from, to) = (JointVector::zeros(), JointVector::from_fn(|i, _| 0.1 * i as f64 - 0.5));
        let rows = quintic(&from, &to, &limits, 1.0 / 30.0);
        let last = rows.last().unwrap();
        assert!((last.q - to).amax() < 1e-12 && last.qd.amax() < 1e-12);
        for row in &rows {
            assert!((0..DOF).all(|i| row.qd[i].abs() <= 0.51 * limits.velocity[i]));
        }
    }
}
