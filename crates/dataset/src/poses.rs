//! Where objects of the data stand, how they are turned about the robot's vertical axis, and where
//! demonstrations begin.

use geometry::Vec3;
use geometry::object::Object;
use geometry::sequence::spread;
use grasps::{Robot, demonstration};
use rand::{Rng, RngExt};
use robot::{Isometry, rotation};

/// The index-th pose of a sequence that fills workspace and yaw evenly ([`geometry::sequence`]).
///
/// *Departure: the paper places objects on a grid; a policy that is tested between its poses learns
/// more from as many poses that lie on no grid.*
pub fn spread_pose(robot: &Robot, index: usize) -> [f32; 3] {
    let share = spread(index);
    let [x, y] = [robot.config.workspace.x, robot.config.workspace.y];
    let pi = std::f32::consts::PI;
    [x[0] + (x[1] - x[0]) * share[0], y[0] + (y[1] - y[0]) * share[1], -pi + 2.0 * pi * share[2]]
}

/// An object pose, turned about the robot's vertical axis.
pub fn turned([x, y, yaw]: [f32; 3], turn: f32) -> [f32; 3] {
    let (sin, cos) = (libm::sinf(turn), libm::cosf(turn));
    [cos * x - sin * y, sin * x + cos * y, yaw + turn]
}

/// A turn (rad) that leaves an object in the workspace, uniformly among these.
pub fn draw_turn(robot: &Robot, pose: [f32; 3], rng: &mut impl Rng) -> f32 {
    let workspace = robot.config.workspace;
    for _ in 0..MOST_DRAWS {
        let turn = rng.random_range(-std::f32::consts::PI..std::f32::consts::PI);
        let [x, y, _] = turned(pose, turn);
        if workspace.contains([x, y]) {
            return turn;
        }
    }
    0.0
}

/// Turns that are drawn until one fits; about one in ten does.
const MOST_DRAWS: usize = 1000;

/// A pose of the palm above the object (base frame) from which a demonstration begins: with the same `rng` the same
/// one at every object pose, relative to the object in front, whatever its yaw.
///
/// *Departure: the paper draws targets anew for each object pose, 256 of them. Of a few, neighbouring
/// poses would have different ones, and a policy between them nothing that it could learn: where a motion
/// begins, the expert would want more different things of them than where it ends.*
pub fn common_target(
    robot: &Robot,
    object: &Object,
    [x, y, _]: [f32; 3],
    palm: &Isometry,
    rng: &mut impl Rng,
) -> Isometry {
    let bearing = libm::atan2f(y, x);
    let in_front = robot.config.upright(libm::hypotf(x, y), 0.0, 0.0);
    // As wide along and across the bearing as the object is on the average: then the yaw does not matter.
    let [min, max] = object.bounds;
    let width = 0.25 * ((max.x - min.x) + (max.y - min.y));
    let bounds = [Vec3::new(-width, -width, min.z), Vec3::new(width, width, max.z)];
    let to_bearing = rotation::about_vertical(f64::from(bearing));
    let palm = to_bearing.inverse() * palm;
    to_bearing * demonstration::draw_target(&robot.config.target, &bounds, &in_front, &palm, rng)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn targets_turn_with_the_object_about_the_robot_and_do_not_see_its_yaw() {
        let robot = Robot::standard().unwrap();
        let object = Object::built_in("bleach").unwrap();
        let pose = [0.5, 0.1, 0.3];
        let palm = robot.tree.kinematics(&robot.nominal).palm();
        let target = |pose, palm: &Isometry| {
            common_target(&robot, &object, pose, palm, &mut ChaCha8Rng::seed_from_u64(3))
        };
        let wanted = target(pose, &palm);
        let is_wanted = |found: Isometry, turn: f64| {
            let off = rotation::about_vertical(turn) * wanted;
            let apart = (found.translation.vector - off.translation.vector).norm();
            assert!(apart < 1e-6, "{apart} m off");
            assert!(rotation::angle_between(&found.rotation, &off.rotation) < 1e-6);
        };
        is_wanted(target([pose[0], pose[1], pose[2] + 1.2], &palm), 0.0);
        for turn in [-0.9f32, 0.4] {
            let turned_palm = rotation::about_vertical(f64::from(turn)) * palm;
            is_wanted(target(turned(pose, turn), &turned_palm), f64::from(turn));
        }
    }
}
