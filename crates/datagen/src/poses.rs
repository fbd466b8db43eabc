//! Object poses of the dataset, their azimuths, and pre-grasp targets of demonstrations.

use dataset::planar_pose::rotate_pose;
use geometry::Vec3;
use geometry::low_discrepancy::kronecker_point;
use grasps::RobotContext;
use grasps::plan::demonstration;
use objects::object::Object;
use rand::{Rng, RngExt};
use robot::{Isometry, rotation};

/// Pose `index` of a low-discrepancy sequence over workspace and yaw ([`geometry::low_discrepancy`]).
///
/// *Departure: the paper places objects on a grid. A policy that is tested between its training poses learns
/// more from the same number of poses that are not on a grid.*
pub fn low_discrepancy_pose(robot: &RobotContext, index: usize) -> [f32; 3] {
    let share = kronecker_point(index);
    let [x, y] = [robot.config.workspace.x, robot.config.workspace.y];
    let pi = std::f32::consts::PI;
    [x[0] + (x[1] - x[0]) * share[0], y[0] + (y[1] - y[0]) * share[1], -pi + 2.0 * pi * share[2]]
}

/// Samples an angle (rad) that keeps the object in the workspace, uniformly.
pub fn sample_azimuth(robot: &RobotContext, pose: [f32; 3], rng: &mut impl Rng) -> f32 {
    let workspace = robot.config.workspace;
    for _ in 0..MAX_SAMPLES {
        let turn = rng.random_range(-std::f32::consts::PI..std::f32::consts::PI);
        let [x, y, _] = rotate_pose(pose, turn);
        if workspace.contains([x, y]) {
            return turn;
        }
    }
    0.0
}

/// Maximum number of samples; about one in ten is accepted.
const MAX_SAMPLES: usize = 1000;

/// Pre-grasp palm pose above the object (base frame), where a demonstration starts. With the same `rng` it is
/// the same at every object pose, relative to the object at azimuth 0, independent of its yaw.
///
/// *Departure: the paper samples 256 new targets for each object pose. With only a few targets, neighboring
/// poses would have different ones. A policy between these poses could not learn from them: the actions of
/// the expert would differ more at the start of a motion than at its end.*
pub fn shared_pregrasp(
    robot: &RobotContext,
    object: &Object,
    [x, y, _]: [f32; 3],
    palm: &Isometry,
    rng: &mut impl Rng,
) -> Isometry {
    let azimuth = libm::atan2f(y, x);
    let in_front = robot.config.object_pose(libm::hypotf(x, y), 0.0, 0.0);
    // The mean width of the object along and across the azimuth makes the region independent of yaw.
    let [min, max] = object.bounds;
    let width = 0.25 * ((max.x - min.x) + (max.y - min.y));
    let bounds = [Vec3::new(-width, -width, min.z), Vec3::new(width, width, max.z)];
    let to_azimuth = rotation::rotation_z(f64::from(azimuth));
    let palm = to_azimuth.inverse() * palm;
    to_azimuth * demonstration::sample_pregrasp_pose(robot, &bounds, &in_front, &palm, rng)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn shared_pregrasp_rotates_with_object_azimuth_and_ignores_yaw() {
        let robot = RobotContext::standard().unwrap();
        let object = Object::from_catalog("bleach").unwrap();
        let pose = [0.5, 0.1, 0.3];
        let palm = robot.tree.forward_kinematics(&robot.nominal).palm_pose();
        let target = |pose, palm: &Isometry| {
            shared_pregrasp(&robot, &object, pose, palm, &mut ChaCha8Rng::seed_from_u64(3))
        };
        let wanted = target(pose, &palm);
        let is_wanted = |found: Isometry, turn: f64| {
            let off = rotation::rotation_z(turn) * wanted;
            let apart = (found.translation.vector - off.translation.vector).norm();
            assert!(apart < 1e-6, "{apart} m off");
            assert!(rotation::angle_between(&found.rotation, &off.rotation) < 1e-6);
        };
        is_wanted(target([pose[0], pose[1], pose[2] + 1.2], &palm), 0.0);
        for turn in [-0.9f32, 0.4] {
            let turned_palm = rotation::rotation_z(f64::from(turn)) * palm;
            is_wanted(target(rotate_pose(pose, turn), &turned_palm), f64::from(turn));
        }
    }
}
