//! Shipped grasps lift in simulation, also with small object pose errors.

use grasps::plan::lift;
use grasps::plan::object_poses::PlannedGrasp;
use grasps::search::robustness::{self, SimilarObject};
use grasps::search::trial::{TrialOutcome, TrialProtocol};
use grasps::set::catalog::catalog_grasps;
use grasps::set::symmetry::expand_by_symmetry;
use grasps::{Grasp, PlacedObject, RobotContext};
use objects::object::Object;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rollout::{Attempt, Controller, RolloutContext};

const REPEATS: usize = 20;
/// Maximum object shift (m) and rotation (rad, 5 degrees) in a repeat.
const SHIFT: f32 = 0.005;
const ROTATION: f32 = 0.0873;

/// Repeats the first grasp of the object's set with perturbed poses. At least `min_lifted` must lift.
fn assert_repeats_lift(name: &str, min_lifted: usize) {
    let robot = RobotContext::standard().unwrap();
    let object = Object::from_catalog(name).unwrap();
    let grasp = &catalog_grasps(name).unwrap().grasps[0];
    let planned =
        PlannedGrasp::plan_at_easiest_yaw(&PlacedObject::at_origin(&robot, &object), grasp)
            .unwrap()
            .expect("a reachable pose");
    let mut rng = ChaCha8Rng::seed_from_u64(20);
    let mut failed = Vec::new();
    for _ in 0..REPEATS {
        let mut draw = |max: f32| rng.random_range(-max..=max);
        let perturbation = [draw(SHIFT), draw(SHIFT), draw(ROTATION)];
        let outcome = planned.try_perturbed(perturbation, TrialProtocol::SHORT).unwrap();
        if !matches!(outcome, TrialOutcome::Lifted { .. }) {
            failed.push(perturbation);
        }
    }
    let lifted = REPEATS - failed.len();
    println!("{name}: grasp 0 lifted in {lifted} of {REPEATS} repeats; failed at {failed:?}");
    assert!(
        lifted >= min_lifted,
        "{name}: lifted in {lifted} of {REPEATS} repeats, not {min_lifted}; failed: {failed:?}"
    );
}

#[test]
fn sugar_box_is_lifted_in_every_repeat() {
    assert_repeats_lift("sugar_box", 20);
}

#[test]
fn bleach_bottle_is_lifted_in_18_of_20_repeats() {
    assert_repeats_lift("bleach", 18);
}

/// Joint tracking errors reach a few hundredths of a radian, and 0.05 rad is a seventh of the squeeze
/// beyond the grasp posture. A squeeze without margin would fail with that error. Half of the squeeze is
/// insufficient for every grasp.
#[test]
fn bleach_bottle_is_held_with_85_percent_of_the_squeeze() {
    let robot = RobotContext::standard().unwrap();
    let object = Object::from_catalog("bleach").unwrap();
    let at_origin = PlacedObject::at_origin(&robot, &object);
    for grasp in catalog_grasps("bleach").unwrap().grasps {
        let lifts = |fraction: f64| {
            let squeeze = std::array::from_fn(|i| {
                grasp.grasp[i] + fraction * (grasp.squeeze[i] - grasp.grasp[i])
            });
            let weaker = Grasp { squeeze, ..grasp.clone() };
            let planned = PlannedGrasp::plan_at_easiest_yaw(&at_origin, &weaker)
                .unwrap()
                .expect("a reachable pose");
            let outcome = planned.try_perturbed([0.0; 3], TrialProtocol::SHORT).unwrap();
            matches!(outcome, TrialOutcome::Lifted { .. })
        };
        assert_eq!([1.0, 0.85, 0.5].map(lifts), [true, true, false], "cluster {}", grasp.cluster);
    }
}

/// Success rate used to select grasps: with a perturbed hand pose, on the object and on similar
/// bottles.
#[test]
fn first_cluster_is_robust_to_hand_pose_error_on_similar_bottles() {
    let robot = RobotContext::standard().unwrap();
    let object = Object::from_catalog("bleach").unwrap();
    let similar = SimilarObject::variants_of(&object).unwrap();
    let rate =
        |grasp: &Grasp| robustness::mean_success_rate(&robot, &object, &similar, grasp).unwrap();
    let grasps = catalog_grasps("bleach").unwrap().grasps;
    let rates: Vec<f64> = grasps.iter().filter(|grasp| grasp.cluster == 0).map(rate).collect();
    // A grasp of the neck alone fails most of the first trials.
    let mut raised = grasps[0].clone();
    raised.object_from_palm.translation.z += 0.08;
    println!("{rates:?}, raised {}", rate(&raised));
    assert!(rates.iter().all(|rate| *rate >= robustness::GOOD_RATE), "{rates:?}");
    assert_eq!(rate(&raised), 0.0);
}

#[test]
fn planner_skips_grasp_whose_lift_is_too_low() {
    let context = RolloutContext::new().unwrap();
    let robot = &context.robot;
    let object = Object::from_catalog("soda_can").unwrap();
    // Close to the robot, the grasp with the smallest arm motion cannot be lifted high enough.
    let pose = [0.48, 0.02, -1.84];
    let grasps = expand_by_symmetry(&object, &catalog_grasps("soda_can").unwrap().grasps);
    let placed =
        PlacedObject::new(robot, &object, &robot.config.object_pose(pose[0], pose[1], pose[2]));
    let (_, first) = placed.reachable(&grasps).next().unwrap();
    let lift = lift::plan_from_grasp(&placed, &first).unwrap().unwrap();
    assert!(lift::lift_height(robot, &lift) < robot.config.protocol.min_hold_height.into());

    let (name, planner) = ("soda_can", Controller::Planner);
    let mut attempt = Attempt::new(&context, &object, name, Some(pose), 0, planner).unwrap();
    let outcome = attempt.run(&context);
    assert!(outcome.is_lifted(), "{outcome:?}");
}
