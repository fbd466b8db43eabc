//! Recorded attempts: JSON round trip and bit-exact replay.

use objects::object::Object;
use rollout::{
    Attempt, AttemptRecording, Controller, DemonstrationFile, FailureReason, Outcome, ReplayFile,
    RolloutContext,
};

/// A planner attempt with the sugar box at seed 0.
fn start_planner_attempt(friction: f32) -> (RolloutContext, Object, Attempt) {
    let context = RolloutContext::new().unwrap();
    let object = Object::from_catalog("sugar_box").unwrap().with_friction(friction);
    let planner = Controller::Planner;
    let attempt = Attempt::new(&context, &object, "sugar_box", None, 0, planner).unwrap();
    (context, object, attempt)
}

#[test]
fn recording_replays_to_its_hash_and_is_rejected_when_altered() {
    let (context, object, mut attempt) = start_planner_attempt(0.8);
    let mut had_contact = false;
    while attempt.outcome().is_none() {
        attempt.step(&context);
        had_contact |= attempt.scene().contact_state().hand;
    }
    println!("{:?} after {} physics steps", attempt.outcome(), attempt.scene().steps());
    assert!(had_contact, "the hand never touched the object");
    assert!(attempt.scene().steps() >= 1000, "only {} steps", attempt.scene().steps());

    let written = serde_json::to_string(&attempt.recording()).unwrap();
    let read: AttemptRecording = serde_json::from_str(&written).unwrap();
    assert_eq!(read, attempt.recording(), "JSON changed the recording");
    let (outcome, hash) = read.replay(&context, &object).unwrap();
    assert_eq!(hash, attempt.state_hash());
    assert_eq!(outcome, attempt.outcome());

    let rejection = |recording: AttemptRecording, object: &Object| {
        recording.replay(&context, object).expect_err("an altered recording").to_string()
    };
    let other_scene = AttemptRecording { scene_hash: "another".into(), ..read.clone() };
    let message = rejection(other_scene, &object);
    assert!(message.contains("another scene") && message.contains(&read.scene_hash), "{message}");
    let message = rejection(read.clone(), &object.clone().with_friction(0.5));
    assert!(message.contains("another object"), "{message}");
    let unbounded = AttemptRecording { object_pose: [1e38, 0.0, 0.0], ..read.clone() };
    assert!(rejection(unbounded, &object).contains("off the table"));
    let mut out_of_range = read.clone();
    out_of_range.targets[7][30] = 1e308;
    assert!(rejection(out_of_range, &object).contains("row 7"));
    let mut short = read;
    short.targets[3].pop();
    let message = rejection(short, &object);
    assert!(message.contains("row 3") && message.contains("45 numbers"), "{message}");
}

#[test]
fn failed_attempt_replays_to_its_outcome() {
    let (context, object, mut attempt) = start_planner_attempt(0.0);
    let outcome = attempt.run(&context);
    assert!(!outcome.is_lifted(), "without friction the object cannot be held: {outcome:?}");
    assert!(attempt.recording().hold_tick.is_some(), "{outcome:?} before the hold");
    let replayed = attempt.recording().replay(&context, &object).unwrap();
    assert_eq!(replayed, (Some(outcome), attempt.state_hash()));

    // An unreachable object ends the attempt immediately.
    let far = Some([1.4, 0.0, 0.0]);
    let planner = Controller::Planner;
    let attempt = Attempt::new(&context, &object, "sugar_box", far, 0, planner).unwrap();
    let outcome = attempt.outcome();
    assert_eq!(outcome, Some(Outcome::Failed { reason: FailureReason::Unreachable }));
    let replayed = attempt.recording().replay(&context, &object).unwrap();
    assert_eq!(replayed, (outcome, attempt.state_hash()));
}

#[test]
fn replay_has_the_phases_of_its_attempt() {
    let (context, object, mut attempt) = start_planner_attempt(0.8);
    let phases = |attempt: &mut Attempt| {
        let mut phases = vec![(attempt.phase(), 0)];
        while attempt.outcome().is_none() {
            attempt.step(&context);
            if phases.last().is_some_and(|(phase, _)| *phase != attempt.phase()) {
                phases.push((attempt.phase(), attempt.ticks()));
            }
        }
        phases
    };
    let recorded = phases(&mut attempt);
    assert_eq!(recorded.len(), 5, "{recorded:?}");
    let text = serde_json::to_vec(&attempt.recording()).unwrap();
    let file = ReplayFile::parse(&text).unwrap();
    assert_eq!(file, ReplayFile::Recording(attempt.recording()));
    let mut replay = file.start_replay(&context, &object).unwrap();
    assert_eq!(phases(&mut replay), recorded);
    assert_eq!(replay.recording(), attempt.recording(), "recording of the replay");
    assert_eq!(replay.motion_metrics(), attempt.motion_metrics());
}

#[test]
fn replay_of_failure_before_lift_fails_at_the_same_tick() {
    // A recording without a lift, as after a collision during the approach. Only the outcome states it.
    let (context, object, mut attempt) = start_planner_attempt(0.8);
    for _ in 0..20 {
        attempt.step(&context);
    }
    let outcome = Outcome::Failed { reason: FailureReason::Collided };
    let recording = AttemptRecording { outcome: Some(outcome), ..attempt.recording() };
    let mut replay = recording.start_replay(&context, &object).unwrap();
    assert_eq!(replay.run(&context), outcome);
    assert_eq!((replay.ticks(), replay.state_hash()), (20, attempt.state_hash()));
}

#[test]
fn changed_target_changes_the_final_state() {
    let (context, object, mut attempt) = start_planner_attempt(0.8);
    for _ in 0..20 {
        attempt.step(&context);
    }
    let mut recording = attempt.recording();
    let (outcome, hash) = recording.replay(&context, &object).unwrap();
    assert_eq!((outcome, &hash), (None, &attempt.state_hash()), "the attempt is unfinished");
    recording.targets[10][0] += 1e-6;
    let (_, changed) = recording.replay(&context, &object).unwrap();
    assert_ne!(changed, hash);
}

#[test]
fn bundled_demonstration_of_the_page_lifts() {
    let recording = include_str!("../../web/src/demo/app/recording.json");
    let recording: DemonstrationFile = serde_json::from_str(recording).unwrap();
    let context = RolloutContext::new().unwrap();
    let object = Object::from_catalog(&recording.object_name).unwrap();
    let hint = "rerun `ngf dataset export-episode DIR N --out web/src/demo/app/recording.json`";
    let mut attempt = recording.start_replay(&context, &object).expect(hint);
    assert!(attempt.run(&context).is_lifted());
}
