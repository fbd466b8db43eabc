//! Where objects of the data stand, and how they are turned about the robot's vertical axis.

use grasps::Robot;
use rand::{Rng, RngExt};

/// The index-th pose of a sequence that fills workspace and yaw evenly (Kronecker, with the roots of
/// x⁴ = x + 1 as in M. Roberts' generalisation of the golden ratio).
///
/// *Departure: the paper places objects on a grid; a policy that is tested between its poses learns
/// more from as many poses that lie on no grid.*
pub fn spread_pose(robot: &Robot, index: usize) -> [f32; 3] {
    const STEPS: [f64; 3] =
        [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_4];
    let share = |k: usize| {
        let at = 0.5 + STEPS[k] * (index + 1) as f64;
        (at - libm::floor(at)) as f32
    };
    let [x, y] = [robot.config.workspace.x, robot.config.workspace.y];
    let pi = std::f32::consts::PI;
    [x[0] + (x[1] - x[0]) * share(0), y[0] + (y[1] - y[0]) * share(1), -pi + 2.0 * pi * share(2)]
}

/// An object pose, turned about the robot's vertical axis.
pub fn turned([x, y, yaw]: [f32; 3], turn: f32) -> [f32; 3] {
    let (sin, cos) = (libm::sinf(turn), libm::cosf(turn));
    [cos * x - sin * y, sin * x + cos * y, yaw + turn]
}

/// A turn (rad) that leaves an object in the workspace, uniformly among these.
pub fn draw_turn(robot: &Robot, pose: [f32; 3], rng: &mut impl Rng) -> f32 {
    let workspace = &robot.config.workspace;
    let is_within = |value: f32, [least, most]: [f32; 2]| (least..=most).contains(&value);
    for _ in 0..MOST_DRAWS {
        let turn = rng.random_range(-std::f32::consts::PI..std::f32::consts::PI);
        let [x, y, _] = turned(pose, turn);
        if is_within(x, workspace.x) && is_within(y, workspace.y) {
            return turn;
        }
    }
    0.0
}

/// Turns that are drawn until one fits; about one in ten does.
const MOST_DRAWS: usize = 1000;
