//! A motion for the tests.

use grasps::Setting;
use grasps::built_in::built_in;
use grasps::demonstration::{self, Demonstration, TrajectoryConfig};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A demonstration of the sugar box where it stands in `setting`.
pub(crate) fn demonstration(setting: &Setting) -> Demonstration {
    let (robot, place) = (setting.robot, &setting.world_from_object);
    let grasps = built_in("sugar_box").unwrap().grasps;
    let (_, posture) = setting.options(&grasps).next().expect("a grasp");
    let palm = robot.tree.kinematics(&posture.touch).palm();
    let (region, bounds) = (&robot.config.target, &setting.object.bounds);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let target = demonstration::draw_target(region, bounds, place, &palm, &mut rng);
    demonstration::demonstrate(setting, &posture, &target, &TrajectoryConfig::standard()).unwrap()
}
