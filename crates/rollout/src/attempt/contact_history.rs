//! Motion and contacts of the object so far, which determine the reason of a failure.

use crate::attempt::FailureReason;
use crate::attempt::evidence::{Evidence, Slip};
use geometry::{Pose, Vec3};
use scene::HoldFailure;

/// Max displacement (m) of the object during the approach.
const MAX_APPROACH_SHIFT: f32 = 0.01;
/// Height (m) above which an object counts as lifted.
const MIN_LIFTED_HEIGHT: f32 = 0.03;
/// Displacement (m) above which an object on the table counts as pushed.
const MIN_PUSH_DISTANCE: f32 = 0.05;

/// Motion and contacts of the object since the start of the attempt.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactHistory {
    /// Initial position of the object (m).
    start_position: Vec3,
    /// Max height (m) above the table so far.
    max_height: f32,
    /// Whether arm or hand touched the object during the approach.
    was_touched: bool,
    /// Max number of fingers in contact with the object since the start of the lift.
    max_fingers: usize,
}

impl ContactHistory {
    /// No motion and no contact yet.
    pub(crate) fn new(start_position: Vec3) -> Self {
        Self { start_position, max_height: 0.0, was_touched: false, max_fingers: 0 }
    }

    /// Adds the height (m) of the object above the table at one tick.
    pub(crate) fn add_height(&mut self, height: f32) {
        self.max_height = self.max_height.max(height);
    }

    /// Adds one tick of the approach: whether arm or hand touch the object.
    pub(crate) fn add_approach_contact(&mut self, is_touched: bool) {
        self.was_touched |= is_touched;
    }

    /// Adds the number of fingers in contact with the object at one tick of lift or hold.
    pub(crate) fn add_finger_contacts(&mut self, fingers: usize) {
        self.max_fingers = self.max_fingers.max(fingers);
    }

    /// Failure of an approach with the object now at `position` (m); `None` if the object has not moved.
    pub(crate) fn approach_failure(&self, position: Vec3) -> Option<FailureReason> {
        let is_displaced = position.distance(self.start_position) > MAX_APPROACH_SHIFT;
        is_displaced.then_some(match self.was_touched {
            true => FailureReason::Collided,
            false => FailureReason::Disturbed,
        })
    }

    /// Reason of a failed hold, from the final object position `end` (m) and the failed hold criterion.
    pub(crate) fn hold_failure(&self, end: Vec3, failure: HoldFailure) -> FailureReason {
        let displacement = self.displacement(end);
        match failure {
            _ if self.max_height <= MIN_LIFTED_HEIGHT && displacement > MIN_PUSH_DISTANCE => {
                FailureReason::PushedAway
            }
            _ if self.max_height <= MIN_LIFTED_HEIGHT => FailureReason::Missed,
            _ if end.z - self.start_position.z <= MIN_LIFTED_HEIGHT => FailureReason::Dropped,
            // The object has just been lost and is still near the hand.
            HoldFailure::NoContact => FailureReason::Dropped,
            HoldFailure::Slipped => FailureReason::Slipped,
            HoldFailure::TooLow | HoldFailure::ForeignContact => FailureReason::TooLow,
        }
    }

    /// Motion of the object, now at `pose` and `height` (m) above the table, without its contacts.
    pub(crate) fn evidence(&self, pose: &Pose, height: f32, slip: Option<Slip>) -> Evidence {
        let cos = (pose.rotation * Vec3::Z).z.clamp(-1.0, 1.0);
        Evidence {
            fingers: 0,
            max_fingers: self.max_fingers,
            palm: false,
            arm: false,
            table: false,
            slip,
            height,
            max_height: self.max_height,
            displacement: self.displacement(pose.translation),
            tilt: libm::acosf(cos),
        }
    }

    /// Horizontal distance (m) of `position` from the initial position of the object.
    fn displacement(&self, position: Vec3) -> f32 {
        (position - self.start_position).truncate().length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failure_reason_follows_object_motion() {
        let reason = |highest, x, z, failure| {
            ContactHistory { max_height: highest, ..ContactHistory::new(Vec3::ZERO) }
                .hold_failure(Vec3::new(x, 0.0, z), failure)
        };
        assert_eq!(reason(0.0, 0.01, 0.0, HoldFailure::TooLow), FailureReason::Missed);
        assert_eq!(reason(0.0, 0.09, 0.0, HoldFailure::TooLow), FailureReason::PushedAway);
        assert_eq!(reason(0.1, 0.0, 0.0, HoldFailure::Slipped), FailureReason::Dropped);
        assert_eq!(reason(0.1, 0.0, 0.1, HoldFailure::Slipped), FailureReason::Slipped);
        assert_eq!(reason(0.1, 0.0, 0.08, HoldFailure::TooLow), FailureReason::TooLow);
        assert_eq!(reason(0.2, 0.0, 0.2, HoldFailure::ForeignContact), FailureReason::TooLow);
        assert_eq!(reason(0.2, 0.0, 0.195, HoldFailure::NoContact), FailureReason::Dropped);
    }

    #[test]
    fn evidence_measures_horizontal_motion_and_tilt() {
        let mut history = ContactHistory::new(Vec3::new(0.5, 0.1, 0.0));
        history.add_height(0.02);
        history.add_height(0.01);
        for fingers in [2, 3, 0] {
            history.add_finger_contacts(fingers);
        }
        let tilted = Pose::new(Vec3::new(0.53, 0.14, 0.2), Vec3::new(0.0, 0.3, 0.0));
        let found = history.evidence(&tilted, 0.01, None);
        assert!((found.displacement - 0.05).abs() < 1e-6, "{}", found.displacement);
        assert!((found.tilt - 0.3).abs() < 1e-3, "{}", found.tilt);
        assert_eq!((found.height, found.max_height, found.max_fingers), (0.01, 0.02, 3));
    }

    #[test]
    fn approach_fails_when_the_object_moves() {
        let mut history = ContactHistory::new(Vec3::ZERO);
        let moved = Vec3::new(0.0, 0.02, 0.0);
        assert_eq!(history.approach_failure(0.4 * moved), None);
        assert_eq!(history.approach_failure(moved), Some(FailureReason::Disturbed));
        history.add_approach_contact(true);
        history.add_approach_contact(false);
        assert_eq!(history.approach_failure(moved), Some(FailureReason::Collided));
    }
}
