//! Quality of demonstrations as training data: postures vary smoothly with the object pose, and
//! trajectories reach their goals with low jerk.

use grasps::plan::demonstration::{self, TrajectoryConfig};
use grasps::plan::object_poses::sample_planar_pose;
use grasps::set::catalog::catalog_grasps;
use grasps::{PlacedObject, RobotContext};
use objects::object::Object;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::integrator;
use scene::config::CONTROL_DT;

const OBJECTS: [&str; 2] = ["sugar_box", "bleach"];

#[test]
fn neighboring_object_poses_have_similar_postures() {
    let robot = RobotContext::standard().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for name in OBJECTS {
        let object = Object::from_catalog(name).unwrap();
        let grasps = catalog_grasps(name).unwrap().grasps;
        let at_origin = PlacedObject::at_origin(&robot, &object);
        let (mut jumps, mut unreachable) = (Vec::new(), 0);
        for _ in 0..300 {
            let [x, y, yaw] = sample_planar_pose(&robot, &mut rng);
            let at = |x, y, yaw| at_origin.at_pose(&robot.config.object_pose(x, y, yaw));
            let here = at(x, y, yaw);
            let Some((branch, posture)) = here.reachable(&grasps).next() else {
                unreachable += 1;
                continue;
            };
            for neighbor in [at(x + 0.02, y, yaw), at(x, y + 0.02, yaw), at(x, y, yaw + 0.1)] {
                let other = neighbor.plan_branch(branch, &grasps);
                jumps.extend(other.map(|other| (other.grasp - posture.grasp).amax()));
            }
        }
        jumps.sort_by(f64::total_cmp);
        let (median, max) = (jumps[jumps.len() / 2], jumps[jumps.len() - 1]);
        println!("{name}: {} pairs, median {median:.3} rad, max {max:.3} rad", jumps.len());
        // The bottle is grasped low, where it is most robust. The arm reaches nearly all poses.
        assert!(unreachable < 6, "{name}: {unreachable} of 300 poses are unreachable");
        assert!(max < 0.6, "{name}: a joint differs by {max} rad");
        assert!(median < 0.1, "{name}: postures differ by {median} rad");
    }
}

#[test]
fn demonstrations_reach_feasible_goals_with_low_jerk() {
    let robot = RobotContext::standard().unwrap();
    let config = TrajectoryConfig::standard();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for name in OBJECTS {
        let object = Object::from_catalog(name).unwrap();
        let grasps = catalog_grasps(name).unwrap().grasps;
        let at_origin = PlacedObject::at_origin(&robot, &object);
        let (mut reached, mut reachable, mut jerks) = (0, 0, Vec::new());
        for _ in 0..100 {
            let [x, y, yaw] = sample_planar_pose(&robot, &mut rng);
            let pose = robot.config.object_pose(x, y, yaw);
            let placed = at_origin.at_pose(&pose);
            let Some((_, posture)) = placed.reachable(&grasps).next() else { continue };
            let palm = robot.tree.forward_kinematics(&posture.grasp).palm_pose();
            let bounds = &object.bounds;
            let target =
                demonstration::sample_pregrasp_pose(&robot, bounds, &pose, &palm, &mut rng);
            let found = demonstration::demonstrate(&placed, &posture, &target, &config);
            if robot.can_reach(&target, &posture) {
                reachable += 1;
                reached +=
                    usize::from(found.as_ref().is_ok_and(|found| found.goal_error.is_reached()));
            }
            jerks.extend(found.map(|found| {
                integrator::rms_jerk(&found.accelerations[..found.contact_row], CONTROL_DT)
            }));
        }
        jerks.sort_by(f64::total_cmp);
        let (median, max) = (jerks[jerks.len() / 2], jerks[jerks.len() - 1]);
        println!(
            "{name}: reached {reached} of {reachable} goals; jerk: median {median:.0}, max {max:.0}"
        );
        // Fewer goals would not be significant.
        assert!(reachable >= 30, "{name}: {reachable} goals");
        assert!(10 * reached >= 9 * reachable, "{name}: {reached} of {reachable}");
        assert!(median < 80.0 && max < 160.0, "{name}: jerk {median}, {max}");
    }
}
