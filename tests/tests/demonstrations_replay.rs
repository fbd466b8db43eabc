//! Demonstrations lift in physics before any filter: what the policy learns from is true.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use geometry::object::Object;
use grasps::Robot;
use grasps::demonstration::{self, TrajectoryConfig};
use imitation::dataset::spread_pose;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

const POSES: usize = 5;
const DEMONSTRATIONS: usize = 4;
/// Targets drawn at a pose at most.
const TARGETS: usize = 12;
/// Seconds of the hold: what slips at all slips within the first half second.
const HOLD: f64 = 0.5;

/// Demonstrations of the nearest grasp at the first poses of the dataset, each replayed: none is left
/// out for how its replay ended. Poses out of reach have none and are counted apart.
fn replay(name: &str) {
    let robot = Robot::standard().unwrap();
    let object = Object::built_in(name).unwrap();
    let grasps = rollout::workcell::built_in_grasps(name).unwrap().grasps;
    let config = TrajectoryConfig::standard();
    let (mut lifted, mut replayed, mut out_of_reach) = (0, 0, 0);
    let mut flaws = BTreeMap::new();
    let mut by_pose = Vec::new();
    let mut index = 0;
    while by_pose.len() < POSES {
        let [x, y, yaw] = spread_pose(&robot, index);
        let place = robot.config.upright(x, y, yaw);
        let mut rng = ChaCha8Rng::seed_from_u64(index as u64);
        index += 1;
        let options = robot.options(&grasps, &object, &place);
        let Some((grasp, posture)) = options.first() else {
            out_of_reach += 1;
            continue;
        };
        let palm = robot.tree.kinematics(&posture.touch).palm();
        let (mut here, mut found) = (0, 0);
        for _ in 0..TARGETS {
            if found == DEMONSTRATIONS {
                break;
            }
            let target = demonstration::draw_target(&robot, &object, &place, &palm, &mut rng);
            match demonstration::demonstrate(&robot, &object, &place, posture, &target, &config) {
                Err(flaw) => *flaws.entry(flaw).or_insert(0) += 1,
                Ok(motion) => {
                    found += 1;
                    let ends = demonstration::replays(&robot, &object, &place, &motion, HOLD);
                    here += usize::from(ends.unwrap());
                }
            }
        }
        by_pose.push(format!("({x:.2}, {y:.2}, {yaw:.2}) grasp {grasp}: {here} of {found}"));
        lifted += here;
        replayed += found;
    }
    println!("{name}: {lifted} of {replayed} lift; {out_of_reach} poses out of reach; {flaws:?}");
    by_pose.iter().for_each(|pose| println!("  {pose}"));
    assert_eq!(replayed, POSES * DEMONSTRATIONS, "{name}: too few motions were planned: {flaws:?}");
    assert!(10 * lifted >= 9 * replayed, "{name}: {lifted} of {replayed} lift: {by_pose:?}");
}

#[test]
fn sugar_box_demonstrations_lift() {
    replay("sugar_box");
}

#[test]
fn bleach_demonstrations_lift() {
    replay("bleach");
}
