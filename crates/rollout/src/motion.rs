//! How a controller moved the joints: what is compared beside success.

use grasps::Setting;
use robot::{JointState, JointVector, integrator};
use scene::config::CONTROL_PERIOD;

/// Where the robot is farther off (m), its distance is not measured.
const FARTHEST: f32 = 0.1;

/// How long before it first touches the hand counts as closing (control periods): 0.4 s.
const CLOSING: usize = 12;

/// A motion between start and lift.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Motion {
    /// Duration (s).
    pub seconds: f64,
    /// Length of the path in joint space (rad, norm over all joints).
    pub path: f64,
    /// Root mean square of the jerk (rad/s³, norm over all joints).
    pub jerk: f64,
}

impl Motion {
    /// Of states that are a control period apart; `None` of fewer than three.
    pub fn of(states: &[JointState]) -> Option<Self> {
        if states.len() < 3 {
            return None;
        }
        let path = states.windows(2).map(|pair| (pair[1].q - pair[0].q).norm()).sum();
        // Eq. 7 the other way round.
        let accelerations: Vec<JointVector> =
            states.windows(2).map(|pair| (pair[1].qd - pair[0].qd) / CONTROL_PERIOD).collect();
        Some(Self {
            seconds: (states.len() - 1) as f64 * CONTROL_PERIOD,
            path,
            jerk: integrator::jerk(&accelerations, CONTROL_PERIOD),
        })
    }
}

/// Least distance (m) of the robot from the table and the object where that stands in `setting`, before the hand closes,
/// which is 0.4 s before the first of these states that touches one of them; at most 0.1 m. `None` if that is at once.
pub(crate) fn clearance(setting: &Setting, states: &[JointState]) -> Option<f32> {
    let gaps: Vec<f32> = states.iter().map(|state| setting.clearance(&state.q, FARTHEST)).collect();
    let touch = gaps.iter().position(|gap| *gap <= 0.0).unwrap_or(gaps.len());
    gaps[..touch.saturating_sub(CLOSING)].iter().copied().reduce(f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;
    use geometry::object::Object;
    use grasps::Robot;
    use robot::DOF;

    #[test]
    fn clearance_is_that_before_the_hand_closes() {
        let robot = Robot::standard().unwrap();
        let object = Object::built_in("sugar_box").unwrap();
        let place = robot.config.upright(0.6, 0.0, 0.0);
        let setting = Setting::new(&robot, &object, &place);
        let motion = samples::demonstration(&setting);
        let states = &motion.states;
        let gap = |tick: usize| setting.clearance(&states[tick].q, FARTHEST);
        let touch = (0..states.len()).find(|tick| gap(*tick) <= 0.0).expect("the hand closes");
        assert!(touch > 2 * CLOSING, "it touches at tick {touch}");
        let found = clearance(&setting, states).unwrap();
        assert_eq!(found, (0..touch - CLOSING).map(gap).fold(FARTHEST, f32::min));
        assert!(found > 0.0 && found < FARTHEST, "{found} m");
        assert_eq!(clearance(&setting, &states[touch - CLOSING..]), None);
    }

    #[test]
    fn a_steady_push_has_a_path_and_no_jerk() {
        let qdd = JointVector::from_element(0.5);
        let mut states = vec![JointState::at_rest(JointVector::zeros())];
        for i in 0..30 {
            states.push(integrator::step(&states[i], &qdd, CONTROL_PERIOD));
        }
        let motion = Motion::of(&states).unwrap();
        let root = libm::sqrt(DOF as f64);
        assert!((motion.seconds - 1.0).abs() < 1e-12 && (motion.path - 0.25 * root).abs() < 1e-9);
        assert!(motion.jerk < 1e-9);
        assert_eq!(Motion::of(&states[..2]), None);
        // A push that is reversed once: one jump of the acceleration by 2 x 0.5 in 31 - 2 differences.
        for i in 30..60 {
            states.push(integrator::step(&states[i], &-qdd, CONTROL_PERIOD));
        }
        let wanted = root * 30.0 / libm::sqrt(59.0);
        assert!((Motion::of(&states).unwrap().jerk - wanted).abs() < 1e-6 * wanted);
    }
}
