//! Control conditions of the evaluation: scripted closing, measured observation, shuffled z and zero z.

use objects::object::Object;
use policy::model::MODEL_FILES;
use robot::ARM_DOF;
use rollout::{
    Attempt, AttemptRecording, Controller, FailureReason, Outcome, RolloutContext, RolloutError,
};
use std::path::Path;

fn context() -> RolloutContext {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default");
    let read = |file: &str| std::fs::read(folder.join(file)).unwrap();
    let [weights, starts, config] = MODEL_FILES.map(|(_, file)| read(file));
    let mut context = RolloutContext::new().unwrap();
    context.load_model(&weights, &starts, &config).unwrap();
    context
}

/// Runs the attempt of seed 0 with the sugar box.
fn attempt(context: &RolloutContext, controller: Controller) -> AttemptRecording {
    let object = Object::from_catalog("sugar_box").unwrap();
    let mut attempt = Attempt::new(context, &object, "sugar_box", None, 0, controller).unwrap();
    attempt.run(context);
    attempt.recording()
}

#[test]
fn scripted_closing_moves_fingers_but_not_the_arm() {
    let recording = attempt(&context(), Controller::ScriptedClose);
    let (from, to) = (recording.policy_tick.unwrap(), recording.lift_tick.unwrap());
    let (first, last) = (&recording.targets[from], &recording.targets[to]);
    for row in &recording.targets[from..=to] {
        assert_eq!(row[..ARM_DOF], first[..ARM_DOF], "the arm moved");
    }
    assert!((last[ARM_DOF + 1] - first[ARM_DOF + 1]).abs() > 0.3, "the fingers did not close");
}

#[test]
fn control_conditions_share_the_start_and_differ_in_actions() {
    let context = context();
    let [policy, measured, shuffled, zero] = [
        Controller::Policy,
        Controller::PolicyMeasured,
        Controller::ShuffledLatent,
        Controller::ZeroLatent,
    ]
    .map(|controller| attempt(&context, controller));
    let begin = policy.policy_tick.unwrap();
    for (name, other) in [("measured", &measured), ("shuffled z", &shuffled), ("zero z", &zero)] {
        assert_eq!(other.policy_tick, Some(begin), "{name}");
        assert_eq!(other.targets[..=begin], policy.targets[..=begin], "{name}: different start");
        // After one second (30 ticks) the targets differ.
        let [a, b] = [other, &policy].map(|recording| &recording.targets[begin + 30]);
        let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        assert!(differences.fold(0.0, f64::max) > 1e-3, "{name} acts like the policy");
    }
    // The conditions also differ from each other.
    assert_ne!(shuffled.targets, zero.targets);
}

#[test]
fn attempt_is_rejected_when_pose_is_invalid_or_demonstration_is_empty() {
    let context = context();
    let object = Object::from_catalog("sugar_box").unwrap();
    let begin = |pose, controller| {
        Attempt::new(&context, &object, "sugar_box", pose, 0, controller).err().unwrap()
    };
    for pose in [[f32::NAN, 0.0, 0.0], [0.6, f32::INFINITY, 0.0], [0.6, 0.0, 1e38]] {
        let error = begin(Some(pose), Controller::Planner);
        assert!(matches!(error, RolloutError::OffTheTable), "{error}");
    }
    let error = begin(None, Controller::Demonstration(Vec::new()));
    assert!(matches!(error, RolloutError::NoStates), "{error}");
}

#[test]
fn attempt_fails_as_not_visible_when_object_is_behind_the_camera() {
    let context = context();
    let object = Object::from_catalog("sugar_box").unwrap();
    let behind_camera = Some([40.0, 0.0, 0.0]);
    let policy = Controller::Policy;
    let mut attempt =
        Attempt::new(&context, &object, "sugar_box", behind_camera, 0, policy).unwrap();
    let outcome = attempt.run(&context);
    assert_eq!(outcome, Outcome::Failed { reason: FailureReason::NotVisible });
    assert_eq!(attempt.ticks(), 0, "the robot moved");
}
