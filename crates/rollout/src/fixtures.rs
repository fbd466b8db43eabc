//! Test fixtures.

use grasps::PlacedObject;
use grasps::plan::demonstration::{self, Demonstration, TrajectoryConfig};
use grasps::set::catalog::catalog_grasps;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Plans a demonstration for the sugar box at the pose of `placed`.
pub(crate) fn demonstration(placed: &PlacedObject) -> Demonstration {
    let (robot, pose) = (placed.robot, &placed.world_from_object);
    let grasps = catalog_grasps("sugar_box").unwrap().grasps;
    let (_, posture) = placed.reachable(&grasps).next().expect("a grasp");
    let palm = robot.tree.forward_kinematics(&posture.grasp).palm_pose();
    let bounds = &placed.object.bounds;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let target = demonstration::sample_pregrasp_pose(robot, bounds, pose, &palm, &mut rng);
    demonstration::demonstrate(placed, &posture, &target, &TrajectoryConfig::standard()).unwrap()
}
