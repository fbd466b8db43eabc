//! Demonstrations lift in simulation without any filtering by outcome.

use datagen::poses::low_discrepancy_pose;
use dataset::planar_pose::rotate_pose;
use grasps::plan::demonstration::{self, Demonstration, TrajectoryConfig};
use grasps::plan::lift;
use grasps::search::trial::{TrialOutcome, TrialProtocol};
use grasps::set::catalog::catalog_grasps;
use grasps::{PlacedObject, Posture, RobotContext};
use objects::object::Object;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

const POSES: usize = 5;
const DEMONSTRATIONS: usize = 4;
/// Maximum number of pregrasp poses sampled per object pose.
const MAX_TARGETS: usize = 12;

/// Whether the object is lifted when the demonstration is replayed.
fn lifts(placed: &PlacedObject, posture: &Posture, motion: &Demonstration) -> bool {
    let lift = lift::plan_from_grasp(placed, posture).unwrap().expect("a lift");
    let outcome = motion.replay(placed, &lift, TrialProtocol::SHORT).unwrap();
    matches!(outcome, TrialOutcome::Lifted { .. })
}

/// Plans demonstrations of the nearest grasp at the first poses of the dataset and replays all of them.
/// Unreachable poses are counted separately.
fn assert_demonstrations_lift(name: &str) {
    let robot = RobotContext::standard().unwrap();
    let object = Object::from_catalog(name).unwrap();
    let grasps = catalog_grasps(name).unwrap().grasps;
    let config = TrajectoryConfig::standard();
    let (mut lifted, mut replayed, mut unreachable) = (0, 0, 0);
    let mut failures = BTreeMap::new();
    let mut by_pose = Vec::new();
    let mut index = 0;
    while by_pose.len() < POSES {
        assert!(index < 10 * POSES, "{name}: {unreachable} of {index} poses are unreachable");
        let [x, y, yaw] = low_discrepancy_pose(&robot, index);
        let pose = robot.config.object_pose(x, y, yaw);
        let mut rng = ChaCha8Rng::seed_from_u64(index as u64);
        index += 1;
        let placed = PlacedObject::new(&robot, &object, &pose);
        let Some((branch, posture)) = placed.reachable(&grasps).next() else {
            unreachable += 1;
            continue;
        };
        let palm = robot.tree.forward_kinematics(&posture.grasp).palm_pose();
        let (mut num_lifted, mut num_planned) = (0, 0);
        for _ in 0..MAX_TARGETS {
            if num_planned == DEMONSTRATIONS {
                break;
            }
            let target =
                demonstration::sample_pregrasp_pose(&robot, &object.bounds, &pose, &palm, &mut rng);
            match demonstration::demonstrate(&placed, &posture, &target, &config) {
                Err(failure) => *failures.entry(failure).or_insert(0) += 1,
                Ok(motion) => {
                    num_planned += 1;
                    num_lifted += usize::from(lifts(&placed, &posture, &motion));
                }
            }
        }
        let count = format!("{num_lifted} of {num_planned}");
        by_pose.push(format!("({x:.2}, {y:.2}, {yaw:.2}) {branch:?}: {count}"));
        lifted += num_lifted;
        replayed += num_planned;
    }
    println!("{name}: {lifted} of {replayed} lift; {unreachable} poses unreachable; {failures:?}");
    by_pose.iter().for_each(|pose| println!("  {pose}"));
    assert_eq!(replayed, POSES * DEMONSTRATIONS, "{name}: too few plans: {failures:?}");
    assert!(10 * lifted >= 9 * replayed, "{name}: {lifted} of {replayed} lift: {by_pose:?}");
}

/// Rotational symmetry that the dataset relies on: rotating object and demonstration about the base axis
/// changes only the first joint.
#[test]
fn rotated_demonstration_lifts_rotated_object() {
    let robot = RobotContext::standard().unwrap();
    let object = Object::from_catalog("sugar_box").unwrap();
    let grasps = catalog_grasps("sugar_box").unwrap().grasps;
    let config = TrajectoryConfig::standard();
    let mut lifted = 0;
    for (pose, turn) in [([0.5, -0.1, 0.4], 0.5), ([0.7, 0.2, -1.0], -0.6), ([0.6, 0.0, 2.5], 0.3)]
    {
        let upright = |[x, y, yaw]: [f32; 3]| robot.config.object_pose(x, y, yaw);
        let here = PlacedObject::new(&robot, &object, &upright(pose));
        let there = here.at_pose(&upright(rotate_pose(pose, turn)));
        let first = |placed: &PlacedObject| placed.reachable(&grasps).next().unwrap();
        let ((grasp, posture), (other, turned_posture)) = (first(&here), first(&there));
        assert_eq!(grasp, other, "different grasp at {pose:?} rotated by {turn}");
        let mut moved = turned_posture.grasp - posture.grasp;
        moved[0] -= f64::from(turn);
        assert!(moved.amax() < 1e-3, "joints differ by {moved}");

        let palm = robot.tree.forward_kinematics(&posture.grasp).palm_pose();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let target = demonstration::sample_pregrasp_pose(
            &robot,
            &object.bounds,
            &here.world_from_object,
            &palm,
            &mut rng,
        );
        let found = demonstration::demonstrate(&here, &posture, &target, &config).unwrap();
        let mut motion = found.clone();
        motion.states.iter_mut().for_each(|state| state.q[0] += f64::from(turn));
        lifted += usize::from(lifts(&there, &turned_posture, &motion));
    }
    assert_eq!(lifted, 3);
}

#[test]
fn sugar_box_demonstrations_lift() {
    assert_demonstrations_lift("sugar_box");
}

#[test]
fn bleach_demonstrations_lift() {
    assert_demonstrations_lift("bleach");
}
