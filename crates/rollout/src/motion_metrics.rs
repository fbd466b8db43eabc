//! Motion metrics of a controller, reported in addition to success.

use crate::attempt::Attempt;
use crate::rollout_context::RolloutContext;
use grasps::PlacedObject;
use robot::{Isometry, JointState, JointVector, integrator, rotation};
use scene::config::CONTROL_DT;

/// Max distance (m) that is measured.
const MAX_CLEARANCE: f32 = 0.1;

/// Control periods before the first contact that count as closing the hand: 0.4 s.
const CLOSING_TICKS: usize = 12;

/// Metrics of the motion between start configuration and lift.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MotionMetrics {
    /// Duration (s).
    pub seconds: f64,
    /// Path length in joint space (rad, norm over all joints).
    pub path: f64,
    /// Root mean square jerk (rad/s³, norm over all joints).
    pub jerk: f64,
}

impl MotionMetrics {
    /// Computes the metrics of states one control period apart; `None` for fewer than three states.
    pub fn from_states(states: &[JointState]) -> Option<Self> {
        if states.len() < 3 {
            return None;
        }
        let path = states.windows(2).map(|pair| (pair[1].q - pair[0].q).norm()).sum();
        // Inverse of Eq. 7.
        let accelerations: Vec<JointVector> =
            states.windows(2).map(|pair| (pair[1].qd - pair[0].qd) / CONTROL_DT).collect();
        Some(Self {
            seconds: (states.len() - 1) as f64 * CONTROL_DT,
            path,
            jerk: integrator::rms_jerk(&accelerations, CONTROL_DT),
        })
    }
}

/// Min distance (m) of the robot to the table and the placed object before the hand closes, up to 0.1 m.
///
/// The hand closes 0.4 s before the first state in contact. `None` if no state precedes the closing.
fn clearance(placed: &PlacedObject, states: &[JointState]) -> Option<f32> {
    let distances: Vec<f32> =
        states.iter().map(|state| placed.clearance(&state.q, MAX_CLEARANCE)).collect();
    let contact = distances.iter().position(|distance| *distance <= 0.0).unwrap_or(distances.len());
    distances[..contact.saturating_sub(CLOSING_TICKS)].iter().copied().reduce(f32::min)
}

impl Attempt {
    /// Motion metrics between start configuration and lift; `None` if the policy phase was not reached.
    pub fn motion_metrics(&self) -> Option<MotionMetrics> {
        MotionMetrics::from_states(self.policy_segment())
    }

    /// Min distance (m) of the robot to the table and to the object at its initial pose, up to 0.1 m.
    ///
    /// The interval is from the start configuration to 0.4 s before the first contact. `None` if it is empty.
    pub fn clearance(&self, context: &RolloutContext) -> Option<f32> {
        let setup = self.setup();
        clearance(
            &PlacedObject::new(&context.robot, &setup.object, &setup.world_from_object),
            self.policy_segment(),
        )
    }

    /// Palm pose relative to the object's initial pose, at the start of the lift; `None` without a lift.
    pub fn object_from_palm(&self, context: &RolloutContext) -> Option<Isometry> {
        let lift_start = self.history().get(self.phase_starts().lift?)?;
        let world_from_object = rotation::to_isometry(&self.setup().world_from_object);
        let palm = context.robot.tree.forward_kinematics(&lift_start.q).palm_pose();
        Some(world_from_object.inverse() * palm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use grasps::RobotContext;
    use objects::object::Object;
    use robot::DOF;

    #[test]
    fn clearance_is_measured_before_the_hand_closes() {
        let robot = RobotContext::standard().unwrap();
        let object = Object::from_catalog("sugar_box").unwrap();
        let pose = robot.config.object_pose(0.6, 0.0, 0.0);
        let placed = PlacedObject::new(&robot, &object, &pose);
        let motion = fixtures::demonstration(&placed);
        let states = &motion.states;
        let distance = |tick: usize| placed.clearance(&states[tick].q, MAX_CLEARANCE);
        let contact =
            (0..states.len()).find(|tick| distance(*tick) <= 0.0).expect("the hand closes");
        assert!(contact > 2 * CLOSING_TICKS, "first contact at tick {contact}");
        let found = clearance(&placed, states).unwrap();
        assert_eq!(found, (0..contact - CLOSING_TICKS).map(distance).fold(MAX_CLEARANCE, f32::min));
        assert!(found > 0.0 && found < MAX_CLEARANCE, "{found} m");
        assert_eq!(clearance(&placed, &states[contact - CLOSING_TICKS..]), None);
    }

    #[test]
    fn constant_acceleration_has_path_and_no_jerk() {
        let qdd = JointVector::from_element(0.5);
        let mut states = vec![JointState::at_rest(JointVector::zeros())];
        for i in 0..30 {
            states.push(integrator::step(&states[i], &qdd, CONTROL_DT));
        }
        let motion = MotionMetrics::from_states(&states).unwrap();
        let root = libm::sqrt(DOF as f64);
        assert!((motion.seconds - 1.0).abs() < 1e-12 && (motion.path - 0.25 * root).abs() < 1e-9);
        assert!(motion.jerk < 1e-9);
        assert_eq!(MotionMetrics::from_states(&states[..2]), None);
        // The acceleration reverses once: one step of 2 x 0.5 in 31 - 2 differences.
        for i in 30..60 {
            states.push(integrator::step(&states[i], &-qdd, CONTROL_DT));
        }
        let wanted = root * 30.0 / libm::sqrt(59.0);
        assert!((MotionMetrics::from_states(&states).unwrap().jerk - wanted).abs() < 1e-6 * wanted);
    }
}
