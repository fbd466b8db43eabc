//! Demonstrations lift in physics before any filter: what the policy learns from is true.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use dataset::poses::{spread_pose, turned};
use geometry::object::Object;
use grasps::built_in::built_in;
use grasps::demonstration::{self, Demonstration, TrajectoryConfig};
use grasps::trial::{Endurance, Physics, TrialOutcome};
use grasps::{Posture, Robot, Setting, lift};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

const POSES: usize = 5;
const DEMONSTRATIONS: usize = 4;
/// Targets drawn at a pose at most.
const TARGETS: usize = 12;

/// Whether arm and hand lift the object when a demonstration is played back.
fn lifts(setting: &Setting, posture: &Posture, motion: &Demonstration) -> bool {
    let lift = lift::plan_after(setting, posture).unwrap().expect("a lift");
    let outcome = motion.replay(Physics::Full, setting, &lift, Endurance::BRIEF).unwrap();
    matches!(outcome, TrialOutcome::Lifted { .. })
}

/// Demonstrations of the nearest grasp at the first poses of the dataset, each replayed: none is left
/// out for how its replay ended. Poses out of reach have none and are counted apart.
fn replay(name: &str) {
    let robot = Robot::standard().unwrap();
    let object = Object::built_in(name).unwrap();
    let grasps = built_in(name).unwrap().grasps;
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
        let setting = Setting::new(&robot, &object, &place);
        let Some((way, posture)) = setting.options(&grasps).next() else {
            out_of_reach += 1;
            continue;
        };
        let palm = robot.tree.kinematics(&posture.touch).palm();
        let (mut here, mut found) = (0, 0);
        for _ in 0..TARGETS {
            if found == DEMONSTRATIONS {
                break;
            }
            let target = demonstration::draw_target(
                &robot.config.target,
                &object.bounds,
                &place,
                &palm,
                &mut rng,
            );
            match demonstration::demonstrate(&setting, &posture, &target, &config) {
                Err(flaw) => *flaws.entry(flaw).or_insert(0) += 1,
                Ok(motion) => {
                    found += 1;
                    here += usize::from(lifts(&setting, &posture, &motion));
                }
            }
        }
        by_pose.push(format!("({x:.2}, {y:.2}, {yaw:.2}) {way:?}: {here} of {found}"));
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
    let grasps = built_in("sugar_box").unwrap().grasps;
    let config = TrajectoryConfig::standard();
    let mut lifted = 0;
    for (pose, turn) in [([0.5, -0.1, 0.4], 0.5), ([0.7, 0.2, -1.0], -0.6), ([0.6, 0.0, 2.5], 0.3)]
    {
        let place = |[x, y, yaw]: [f32; 3]| robot.config.upright(x, y, yaw);
        let here = Setting::new(&robot, &object, &place(pose));
        let there = here.elsewhere(&place(turned(pose, turn)));
        let first = |setting: &Setting| setting.options(&grasps).next().unwrap();
        let ((grasp, posture), (other, turned_posture)) = (first(&here), first(&there));
        assert_eq!(grasp, other, "another grasp at {pose:?} turned by {turn}");
        let mut moved = turned_posture.touch - posture.touch;
        moved[0] -= f64::from(turn);
        assert!(moved.amax() < 1e-3, "joints move by {moved}");

        let palm = robot.tree.kinematics(&posture.touch).palm();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (region, bounds) = (&robot.config.target, &object.bounds);
        let target =
            demonstration::draw_target(region, bounds, &here.world_from_object, &palm, &mut rng);
        let found = demonstration::demonstrate(&here, &posture, &target, &config).unwrap();
        let mut motion = found.clone();
        motion.states.iter_mut().for_each(|state| state.q[0] += f64::from(turn));
        lifted += usize::from(lifts(&there, &turned_posture, &motion));
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
