//! The controls are what they are called.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use geometry::object::Object;
use robot::ARM;
use rollout::{Attempt, Controller, Episode, Failure, RolloutError, Verdict, Workcell};
use std::path::Path;

fn workcell() -> Workcell {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default");
    let read = |file: &str| std::fs::read(folder.join(file)).unwrap();
    let [weights, starts, config] =
        ["weights.safetensors", "starts.safetensors", "config.json"].map(read);
    let mut workcell = Workcell::new().unwrap();
    workcell.load_model(&weights, &starts, &config).unwrap();
    workcell
}

/// The attempt of seed 0 with the sugar box, played through.
fn attempt(workcell: &Workcell, controller: Controller) -> Episode {
    let object = Object::built_in("sugar_box").unwrap();
    let mut attempt = Attempt::begin(workcell, &object, "sugar_box", None, 0, controller).unwrap();
    attempt.run(workcell);
    attempt.episode()
}

#[test]
fn without_a_policy_fingers_close_and_the_arm_rests() {
    let episode = attempt(&workcell(), Controller::Script);
    let (from, to) = (episode.policy_tick.unwrap(), episode.lift_tick.unwrap());
    let (first, last) = (&episode.targets[from], &episode.targets[to]);
    for row in &episode.targets[from..=to] {
        assert_eq!(row[..ARM], first[..ARM], "the arm moved");
    }
    assert!((last[ARM + 1] - first[ARM + 1]).abs() > 0.3, "the fingers did not close");
}

#[test]
fn controls_begin_where_the_policy_does_and_act_otherwise() {
    let workcell = workcell();
    let [policy, measured, shuffled, zero] = [
        Controller::Policy,
        Controller::Measured,
        Controller::ShuffledLatent,
        Controller::ZeroLatent,
    ]
    .map(|controller| attempt(&workcell, controller));
    let begin = policy.policy_tick.unwrap();
    for (name, other) in [("measured", &measured), ("shuffled z", &shuffled), ("zero z", &zero)] {
        assert_eq!(other.policy_tick, Some(begin), "{name}");
        assert_eq!(other.targets[..=begin], policy.targets[..=begin], "{name}: the same start");
        // A second later they are elsewhere.
        let [a, b] = [other, &policy].map(|episode| &episode.targets[begin + 30]);
        let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) > 1e-3, "{name} acts as the policy does");
    }
    // And each in its own way.
    assert_ne!(shuffled.targets, zero.targets);
}

#[test]
fn what_cannot_begin_says_so() {
    let workcell = workcell();
    let object = Object::built_in("sugar_box").unwrap();
    let begin = |pose, controller| {
        Attempt::begin(&workcell, &object, "sugar_box", pose, 0, controller).err().unwrap()
    };
    for pose in [[f32::NAN, 0.0, 0.0], [0.6, f32::INFINITY, 0.0], [0.6, 0.0, 1e38]] {
        let error = begin(Some(pose), Controller::Planner);
        assert!(matches!(error, RolloutError::OffTheTable), "{error}");
    }
    let error = begin(None, Controller::Demonstration(Vec::new()));
    assert!(matches!(error, RolloutError::NoStates), "{error}");
}

#[test]
fn what_the_camera_does_not_see_is_not_grasped() {
    let workcell = workcell();
    let object = Object::built_in("sugar_box").unwrap();
    // Behind the camera.
    let away = Some([40.0, 0.0, 0.0]);
    let mut attempt =
        Attempt::begin(&workcell, &object, "sugar_box", away, 0, Controller::Policy).unwrap();
    let verdict = attempt.run(&workcell);
    assert_eq!(verdict, Verdict::Failed { reason: Failure::Unseen });
    assert_eq!(attempt.ticks(), 0, "nothing moves");
}
