//! What makes demonstrations easy to learn from: postures that change little from pose to pose, and motions that
//! arrive without trembling.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use geometry::object::Object;
use grasps::built_in::built_in;
use grasps::demonstration::{self, TrajectoryConfig};
use grasps::place::random_pose;
use grasps::{Robot, Setting};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::integrator;
use scene::config::CONTROL_PERIOD;

const OBJECTS: [&str; 2] = ["sugar_box", "bleach"];

#[test]
fn a_grasp_has_neighbouring_postures_for_neighbouring_poses() {
    let robot = Robot::standard().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for name in OBJECTS {
        let object = Object::built_in(name).unwrap();
        let grasps = built_in(name).unwrap().grasps;
        let anywhere = Setting::anywhere(&robot, &object);
        let (mut jumps, mut out_of_reach) = (Vec::new(), 0);
        for _ in 0..300 {
            let [x, y, yaw] = random_pose(&robot, &mut rng);
            let at = |x, y, yaw| anywhere.elsewhere(&robot.config.upright(x, y, yaw));
            let here = at(x, y, yaw);
            let Some((way, posture)) = here.options(&grasps).next() else {
                out_of_reach += 1;
                continue;
            };
            for beside in [at(x + 0.02, y, yaw), at(x, y + 0.02, yaw), at(x, y, yaw + 0.1)] {
                let other = beside.reach_by(way, &grasps);
                jumps.extend(other.map(|other| (other.touch - posture.touch).amax()));
            }
        }
        jumps.sort_by(f64::total_cmp);
        let (median, greatest) = (jumps[jumps.len() / 2], jumps[jumps.len() - 1]);
        println!("{name}: {} pairs, median {median:.3} rad, greatest {greatest:.3}", jumps.len());
        // The bottle is grasped low, where it bears most; the arm gets there nearly everywhere.
        assert!(out_of_reach < 6, "{name}: {out_of_reach} of 300 poses are out of reach");
        assert!(greatest < 0.6, "{name}: a joint jumps by {greatest} rad");
        assert!(median < 0.1, "{name}: postures differ by {median} rad");
    }
}

#[test]
fn motions_arrive_where_the_arm_can_and_do_not_tremble() {
    let robot = Robot::standard().unwrap();
    let config = TrajectoryConfig::standard();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for name in OBJECTS {
        let object = Object::built_in(name).unwrap();
        let grasps = built_in(name).unwrap().grasps;
        let anywhere = Setting::anywhere(&robot, &object);
        let (mut arrived, mut in_reach, mut jerks) = (0, 0, Vec::new());
        for _ in 0..100 {
            let [x, y, yaw] = random_pose(&robot, &mut rng);
            let place = robot.config.upright(x, y, yaw);
            let setting = anywhere.elsewhere(&place);
            let Some((_, posture)) = setting.options(&grasps).next() else { continue };
            let palm = robot.tree.kinematics(&posture.touch).palm();
            let (region, bounds) = (&robot.config.target, &object.bounds);
            let target = demonstration::draw_target(region, bounds, &place, &palm, &mut rng);
            let found = demonstration::demonstrate(&setting, &posture, &target, &config);
            if robot.reaches(&target, &posture) {
                in_reach += 1;
                arrived += usize::from(found.as_ref().is_ok_and(|found| found.miss.is_arrival()));
            }
            jerks.extend(found.map(|found| {
                integrator::jerk(&found.accelerations[..found.touch], CONTROL_PERIOD)
            }));
        }
        jerks.sort_by(f64::total_cmp);
        let (median, greatest) = (jerks[jerks.len() / 2], jerks[jerks.len() - 1]);
        println!(
            "{name}: arrived at {arrived} of {in_reach}; jerk {median:.0}, {greatest:.0} at most"
        );
        // Fewer would say nothing.
        assert!(in_reach >= 30 && 10 * arrived >= 9 * in_reach, "{name}: {arrived} of {in_reach}");
        assert!(median < 80.0 && greatest < 160.0, "{name}: jerk {median}, {greatest}");
    }
}
