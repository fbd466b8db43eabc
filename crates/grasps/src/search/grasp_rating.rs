//! Rating of a grasp for the demonstrations of a policy: how often it lifts under hand pose error, and whether a
//! lowered hand lifts more often.
//!
//! A policy is off by 10 mm. Above a flat object, fingertips that are 10 mm too high close over its top. A hand that
//! is commanded lower presses the fingertips on the table, and the fingers close along it; motors and arm comply.
//!
//! Mean success rate of 24 grasps of eight objects up to 27 mm high, 16 trials each (one run; no command prints it):
//!
//! | hand lower by | error as in [`robustness`] | 40 % of this error |
//! |---|---|---|
//! | -5 mm (higher) | 0.08 | 0.13 |
//! | 0 | 0.24 | 0.60 |
//! | 5 mm | 0.39 | 0.74 |
//! | 10 mm | 0.39 | 0.72 |
//! | 15 mm | 0.42 | 0.65 |
//! | 20 mm | 0.45 | 0.62 |

use crate::plan::object_poses::PlannedGrasp;
use crate::search::robustness;
use crate::set::grasp::Grasp;
use crate::{PlacedObject, RobotContext};
use objects::object::Object;
use robot::JointVector;
use scene::SceneError;

/// Heights (m) by which a hand may be lower than its grasp was found. With a small error, a deeper hand lifts less often.
pub const LOWERINGS: [f64; 3] = [0.0, 0.008, 0.016];

/// Max. height (m) of the lowest fingertip above the table at which a lowered hand is tried.
pub const MAX_FINGERTIP_HEIGHT: f64 = 0.03;

/// Rating of a grasp.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GraspRating {
    /// Success rate of short trials with hand pose error.
    pub success_rate: f32,
    /// Index of the height in [`LOWERINGS`] by which the hand is lowered.
    pub lowering: usize,
}

impl GraspRating {
    /// Rates a grasp of an object. The hand is lowered if that lifts more often. An unreachable grasp has rate 0.
    pub fn of(robot: &RobotContext, object: &Object, grasp: &Grasp) -> Result<Self, SceneError> {
        let Some(planned) =
            PlannedGrasp::plan_at_easiest_yaw(&PlacedObject::at_origin(robot, object), grasp)?
        else {
            return Ok(Self::default());
        };
        let is_low = lowest_fingertip(robot, &planned.posture.grasp) < MAX_FINGERTIP_HEIGHT;
        let lowerings = if is_low { &LOWERINGS[..] } else { &LOWERINGS[..1] };
        let mut best = Self::default();
        for (lowering, depth) in lowerings.iter().enumerate() {
            let rate = robustness::estimated_success_rate(&planned, grasp, *depth)? as f32;
            if rate > best.success_rate {
                best = Self { success_rate: rate, lowering };
            }
        }
        Ok(best)
    }
}

/// Height (m) of the lowest fingertip above the table, at joint positions `q` (rad).
pub fn lowest_fingertip(robot: &RobotContext, q: &JointVector) -> f64 {
    let tips = robot.tree.forward_kinematics(q).fingertips();
    tips.iter().map(|tip| tip.z).fold(f64::INFINITY, f64::min) - f64::from(robot.config.table_top())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::set::catalog::catalog_grasps;

    #[test]
    fn grasp_of_a_tall_object_is_not_lowered() {
        let robot = RobotContext::standard().unwrap();
        let object = Object::from_catalog("bleach").unwrap();
        let grasps = catalog_grasps("bleach").unwrap().grasps;
        let rating = GraspRating::of(&robot, &object, &grasps[0]).unwrap();
        assert!(rating.success_rate > 0.5 && rating.lowering == 0, "{rating:?}");
        // Above the object, the fingers close on nothing.
        let mut high = grasps[0].clone();
        high.object_from_palm.translation.z += 0.2;
        let rating = GraspRating::of(&robot, &object, &high).unwrap();
        assert_eq!(rating, GraspRating::default());
    }
}
