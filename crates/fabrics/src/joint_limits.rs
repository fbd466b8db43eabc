//! Joint-limit avoidance.
//!
//! *Departure: the published fabric repels joints from a limit with a term that acts only while they approach
//! it. At 30 Hz this switch oscillates, because one step reverses the joint velocity. Here a limit bounds the
//! acceleration instead. The bound is continuous where it becomes active and does not affect joints far from
//! it.*

use robot::{DOF, JointLimits, JointMatrix, JointState, JointVector};

/// Parameters of the joint limits.
#[derive(Clone, Copy, Debug)]
pub struct JointLimitConfig {
    /// Distance (rad) from a limit at which joints stop.
    pub margin: f64,
    /// Max approach rate (1/s): at a distance d (rad), the speed towards the limit is up to `rate` d.
    pub rate: f64,
    /// Weight of the limit relative to the joint's own metric.
    pub priority: f64,
}

impl JointLimitConfig {
    /// Constrains the acceleration `qdd` (rad/s²) near the joint limits; the deviation is minimal in
    /// `metric`.
    ///
    /// The distance h of a joint from its limit satisfies ḧ >= -2 λ ḣ - λ² h, so it shrinks no faster than a
    /// critically damped oscillator (exponential control barrier function, Nguyen and Sreenath 2016). Joints
    /// that would violate the bound are constrained, and the remaining joints compensate. `None` if the
    /// metric is singular.
    pub fn constrain(
        &self,
        metric: &JointMatrix,
        qdd: JointVector,
        state: &JointState,
        limits: &JointLimits,
    ) -> Option<JointVector> {
        let (mut augmented_metric, mut force) = (*metric, JointVector::zeros());
        for i in 0..DOF {
            for side in [-1.0, 1.0] {
                let limit = if side > 0.0 { limits.upper[i] } else { limits.lower[i] };
                let distance = side * (limit - state.q[i]) - self.margin;
                let speed = -side * state.qd[i];
                let bound = -2.0 * self.rate * speed - self.rate * self.rate * distance;
                let violation = bound + side * qdd[i];
                if violation > 0.0 {
                    let weight = self.priority * metric[(i, i)];
                    augmented_metric[(i, i)] += weight;
                    force[i] -= side * weight * violation;
                }
            }
        }
        if force == JointVector::zeros() {
            return Some(qdd);
        }
        Some(qdd + augmented_metric.cholesky()?.solve(&force))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::{KinematicTree, integrator};

    const CONFIG: JointLimitConfig = JointLimitConfig { margin: 0.02, rate: 5.0, priority: 100.0 };

    fn limits() -> JointLimits {
        KinematicTree::iiwa7_allegro().unwrap().limits
    }

    /// A state with all joints centred, except `joint` at `distance` (rad) from its upper limit.
    fn near(joint: usize, distance: f64, speed: f64) -> JointState {
        let mut state = JointState::at_rest((limits().lower + limits().upper) * 0.5);
        state.q[joint] = limits().upper[joint] - distance;
        state.qd[joint] = speed;
        state
    }

    fn unit(joint: usize) -> JointVector {
        JointVector::from_fn(|i, _| f64::from(u8::from(i == joint)))
    }

    #[test]
    fn joint_far_from_limits_is_unconstrained() {
        let identity = JointMatrix::identity();
        let constrain =
            |state: &JointState, qdd| CONFIG.constrain(&identity, qdd, state, &limits()).unwrap();
        for (state, qdd) in [
            (near(3, 0.5, 0.0), unit(3)),
            (near(3, 0.5, 1.0), unit(3) * -10.0),
            // At the limit, moving away.
            (near(3, 0.02, 0.0), unit(3) * -1.0),
            (near(3, 0.02, -1.0), unit(3)),
        ] {
            assert_eq!(constrain(&state, qdd), qdd);
        }
    }

    #[test]
    fn joint_driven_against_limit_stops_without_oscillation() {
        let metric = JointMatrix::identity() * 3.0;
        let mut state = near(6, 0.4, 0.0);
        let (mut min_distance, mut last) = (f64::INFINITY, 0.0);
        for row in 0..150 {
            let qdd = CONFIG.constrain(&metric, unit(6) * 4.0, &state, &limits()).unwrap();
            // Accelerated, braked, then released: the acceleration changes direction up to twice.
            if row > 30 {
                assert!(
                    qdd[6] >= last - 1e-9 || qdd[6].abs() < 0.01,
                    "row {row}: {} after {last}",
                    qdd[6]
                );
            }
            last = qdd[6];
            state = integrator::step(&state, &qdd, 1.0 / 30.0);
            min_distance = min_distance.min(limits().upper[6] - state.q[6]);
        }
        let distance = limits().upper[6] - state.q[6];
        assert!(
            min_distance > 0.015 && (0.015..0.025).contains(&distance),
            "{min_distance}, {distance}"
        );
        assert!(state.qd[6].abs() < 1e-3);
    }

    #[test]
    fn other_joints_compensate_for_constrained_joint() {
        // Two joints share a task: the sum of their accelerations.
        let task = unit(2) + unit(4);
        let metric = JointMatrix::identity() * 0.01 + task * task.transpose();
        let wanted = unit(2) + unit(4);
        let constrained =
            CONFIG.constrain(&metric, wanted, &near(2, 0.02, 0.0), &limits()).unwrap();
        assert!(
            constrained[2].abs() < 0.05 && (constrained[4] - 2.0).abs() < 0.1,
            "{} and {}",
            constrained[2],
            constrained[4]
        );
    }
}
