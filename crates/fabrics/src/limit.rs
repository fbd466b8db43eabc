//! Keeps joints off their limits.
//!
//! *Departure: a published fabric pushes joints off their limits by a term that acts on those that move towards one. At
//! 30 Hz such a switch trembles: what it takes from a joint's speed in one step is more than the speed. Here a limit
//! bounds the acceleration instead, which changes nothing for a joint that stays clear of it and is continuous where it
//! sets in.*

use robot::{DOF, JointMatrix, JointState, JointVector, Limits};

/// Parameters of the joint limits.
#[derive(Clone, Copy, Debug)]
pub struct LimitConfig {
    /// Distance (rad) from a limit at which joints come to rest.
    pub margin: f64,
    /// Rate (1/s) at which they approach it at most: a joint at a distance d moves towards it with `rate` d.
    pub rate: f64,
    /// Priority of a joint at a limit: how much more it weighs than what would move it.
    pub priority: f64,
}

impl LimitConfig {
    /// Bounds the acceleration (rad/s²) that minimises the distance to `qdd` in `metric`.
    ///
    /// The distance h of a joint from its limit obeys ḧ >= -2 λ ḣ - λ² h: it never shrinks faster than that of a
    /// critically damped oscillator (an exponential control barrier function, Nguyen and Sreenath 2016). Joints that
    /// would break this are held, and the others make up for them as well as they can.
    pub fn hold(
        &self,
        metric: &JointMatrix,
        qdd: JointVector,
        state: &JointState,
        limits: &Limits,
    ) -> Option<JointVector> {
        let (mut held, mut force) = (*metric, JointVector::zeros());
        for i in 0..DOF {
            for side in [-1.0, 1.0] {
                let limit = if side > 0.0 { limits.upper[i] } else { limits.lower[i] };
                let distance = side * (limit - state.q[i]) - self.margin;
                let speed = -side * state.qd[i];
                let least = -2.0 * self.rate * speed - self.rate * self.rate * distance;
                let missing = least + side * qdd[i];
                if missing > 0.0 {
                    let weight = self.priority * metric[(i, i)];
                    held[(i, i)] += weight;
                    force[i] -= side * weight * missing;
                }
            }
        }
        if force == JointVector::zeros() {
            return Some(qdd);
        }
        Some(qdd + held.cholesky()?.solve(&force))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::{Tree, integrator};

    const CONFIG: LimitConfig = LimitConfig { margin: 0.02, rate: 5.0, priority: 100.0 };

    fn limits() -> Limits {
        Tree::iiwa7_allegro().unwrap().limits
    }

    /// In the middle of all limits but for one joint, which is `distance` from its upper one.
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
    fn a_joint_that_stays_clear_is_left_alone() {
        let identity = JointMatrix::identity();
        let hold = |state: &JointState, qdd| CONFIG.hold(&identity, qdd, state, &limits()).unwrap();
        for (state, qdd) in [
            (near(3, 0.5, 0.0), unit(3)),
            (near(3, 0.5, 1.0), unit(3) * -10.0),
            // At the limit and leaving it.
            (near(3, 0.02, 0.0), unit(3) * -1.0),
            (near(3, 0.02, -1.0), unit(3)),
        ] {
            assert_eq!(hold(&state, qdd), qdd);
        }
    }

    #[test]
    fn a_joint_that_is_driven_against_a_limit_comes_to_rest_there_without_trembling() {
        let metric = JointMatrix::identity() * 3.0;
        let mut state = near(6, 0.4, 0.0);
        let (mut before, mut last) = (f64::INFINITY, 0.0);
        for row in 0..150 {
            let qdd = CONFIG.hold(&metric, unit(6) * 4.0, &state, &limits()).unwrap();
            // Driven on, then braked, then let go: two turns of the acceleration at most.
            if row > 30 {
                assert!(
                    qdd[6] >= last - 1e-9 || qdd[6].abs() < 0.01,
                    "row {row}: {} after {last}",
                    qdd[6]
                );
            }
            last = qdd[6];
            state = integrator::step(&state, &qdd, 1.0 / 30.0);
            before = before.min(limits().upper[6] - state.q[6]);
        }
        let distance = limits().upper[6] - state.q[6];
        assert!(before > 0.015 && (0.015..0.025).contains(&distance), "{before}, {distance}");
        assert!(state.qd[6].abs() < 1e-3);
    }

    #[test]
    fn the_others_make_up_for_a_joint_that_is_held() {
        // Two joints share a task, the sum of their accelerations.
        let task = unit(2) + unit(4);
        let metric = JointMatrix::identity() * 0.01 + task * task.transpose();
        let wanted = unit(2) + unit(4);
        let held = CONFIG.hold(&metric, wanted, &near(2, 0.02, 0.0), &limits()).unwrap();
        assert!(held[2].abs() < 0.05 && (held[4] - 2.0).abs() < 0.1, "{} and {}", held[2], held[4]);
    }
}
