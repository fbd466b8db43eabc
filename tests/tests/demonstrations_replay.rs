//! Demonstrations lift in physics before any filter: what the policy learns from is true.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use geometry::object::Object;
use grasps::Robot;
use grasps::demonstration::{self, TrajectoryConfig};
use grasps::trial::HOLD_SECONDS;
use imitation::poses::{spread_pose, turned};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

const POSES: usize = 5;
const DEMONSTRATIONS: usize = 4;
/// Targets drawn at a pose at most.
const TARGETS: usize = 12;

/// Demonstrations of the nearest grasp at the first poses of the dataset, each replayed: none is left
/// out for how its replay ended. Poses out of reach have none and are counted apart.
fn replay(name: &str) {
    let robot = Robot::standard().unwrap();
    let object = Object::built_in(name).unwrap();
    let grasps = rollout::workcell::built_in_grasps(name).unwrap().unwrap().grasps;
    let config = TrajectoryConfig::standard();
    let (mut lifted, mut replayed, mut out_of_reach) = (0, 0, 0);
    let mut flaws = BTreeMap::new();
    let mut by_pose = Vec::new();
    let mut index = 0;
    while by_pose.len() < POSES {
        assert!(index < 10 * POSES, "{name}: {out_of_reach} of {index} poses out of reach");
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
                    let ends =
                        demonstration::replays(&robot, &object, &place, &motion, HOLD_SECONDS);
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

/// What the dataset makes use of: nothing changes but the first joint when object and demonstration turn
/// about its axis.
#[test]
fn demonstrations_turn_with_the_object() {
    let robot = Robot::standard().unwrap();
    let object = Object::built_in("sugar_box").unwrap();
    let grasps = rollout::workcell::built_in_grasps("sugar_box").unwrap().unwrap().grasps;
    let config = TrajectoryConfig::standard();
    let mut lifted = 0;
    for (pose, turn) in [([0.5, -0.1, 0.4], 0.5), ([0.7, 0.2, -1.0], -0.6), ([0.6, 0.0, 2.5], 0.3)]
    {
        let place = |[x, y, yaw]: [f32; 3]| robot.config.upright(x, y, yaw);
        let (here, there) = (place(pose), place(turned(pose, turn)));
        let first = |place| robot.options(&grasps, &object, place).into_iter().next().unwrap();
        let ((grasp, posture), (other, turned)) = (first(&here), first(&there));
        assert_eq!(grasp, other, "another grasp at {pose:?} turned by {turn}");
        let mut moved = turned.touch - posture.touch;
        moved[0] -= f64::from(turn);
        assert!(moved.amax() < 1e-3, "joints move by {moved}");

        let palm = robot.tree.kinematics(&posture.touch).palm();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let target = demonstration::draw_target(&robot, &object, &here, &palm, &mut rng);
        let found =
            demonstration::demonstrate(&robot, &object, &here, &posture, &target, &config).unwrap();
        let mut motion = found.clone();
        motion.states.iter_mut().for_each(|state| state.q[0] += f64::from(turn));
        let ends = demonstration::replays(&robot, &object, &there, &motion, HOLD_SECONDS).unwrap();
        lifted += usize::from(ends);
    }
    assert_eq!(lifted, 3);
}

#[test]
fn sugar_box_demonstrations_lift() {
    replay("sugar_box");
}

#[test]
fn bleach_demonstrations_lift() {
    replay("bleach");
}
