//! An attempt is recorded, travels as JSON, and replays to the same bits.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use geometry::object::Object;
use rollout::{Attempt, Controller, Demonstration, Episode, Failure, Tape, Verdict, Workcell};
use scene::Simulation;

/// An attempt of the planner.
fn begin(friction: f32) -> (Workcell, Object, Attempt) {
    let workcell = Workcell::new().unwrap();
    let object = Object::built_in("sugar_box").unwrap().with_friction(friction);
    let planner = Controller::Planner;
    let attempt = Attempt::begin(&workcell, &object, "sugar_box", None, 0, planner).unwrap();
    (workcell, object, attempt)
}

#[test]
fn an_episode_replays_to_its_own_hash_and_is_refused_elsewhere() {
    let (workcell, object, mut attempt) = begin(0.8);
    let mut has_touched = false;
    while attempt.verdict().is_none() {
        attempt.tick(&workcell);
        has_touched |= attempt.scene().touching().hand;
    }
    println!("{:?} after {} physics steps", attempt.verdict(), attempt.scene().steps());
    assert!(has_touched, "the hand never touched the object");
    assert!(attempt.scene().steps() >= 1500, "only {} steps", attempt.scene().steps());

    let written = serde_json::to_string(&attempt.episode()).unwrap();
    let read: Episode = serde_json::from_str(&written).unwrap();
    assert_eq!(read, attempt.episode(), "JSON changed the episode");
    let (verdict, hash) = read.replay(&workcell, &object).unwrap();
    assert_eq!(hash, attempt.state_hash());
    assert_eq!(verdict, attempt.verdict());

    let refusal = |episode: Episode, object: &Object| {
        episode.replay(&workcell, object).expect_err("a foreign episode").to_string()
    };
    let elsewhere = Episode { scene: "another".into(), ..read.clone() };
    let message = refusal(elsewhere, &object);
    assert!(message.contains("another scene") && message.contains(&read.scene), "{message}");
    let message = refusal(read.clone(), &object.clone().with_friction(0.5));
    assert!(message.contains("another object"), "{message}");
    let unbounded = Episode { pose: [1e38, 0.0, 0.0], ..read.clone() };
    assert!(refusal(unbounded, &object).contains("off the table"));
    let mut wild = read.clone();
    wild.targets[7][30] = 1e308;
    assert!(refusal(wild, &object).contains("row 7"));
    let mut short = read;
    short.targets[3].pop();
    let message = refusal(short, &object);
    assert!(message.contains("row 3") && message.contains("45 numbers"), "{message}");
}

#[test]
fn a_failed_attempt_replays_to_its_own_verdict() {
    let (workcell, object, mut attempt) = begin(0.0);
    let verdict = attempt.run(&workcell);
    assert!(!verdict.is_lifted(), "without friction nothing is held: {verdict:?}");
    assert!(attempt.episode().hold_tick.is_some(), "{verdict:?} before the hold");
    let replayed = attempt.episode().replay(&workcell, &object).unwrap();
    assert_eq!(replayed, (Some(verdict), attempt.state_hash()));

    // What is out of reach ends before it begins.
    let far = Some([1.4, 0.0, 0.0]);
    let planner = Controller::Planner;
    let attempt = Attempt::begin(&workcell, &object, "sugar_box", far, 0, planner).unwrap();
    let verdict = attempt.verdict();
    assert_eq!(verdict, Some(Verdict::Failed { reason: Failure::Unreachable }));
    let replayed = attempt.episode().replay(&workcell, &object).unwrap();
    assert_eq!(replayed, (verdict, attempt.state_hash()));
}

#[test]
fn a_recording_goes_through_the_phases_of_its_attempt() {
    let (workcell, object, mut attempt) = begin(0.8);
    let phases = |attempt: &mut Attempt| {
        let mut phases = vec![(attempt.phase(), 0)];
        while attempt.verdict().is_none() {
            attempt.tick(&workcell);
            if phases.last().is_some_and(|(phase, _)| *phase != attempt.phase()) {
                phases.push((attempt.phase(), attempt.ticks()));
            }
        }
        phases
    };
    let lived = phases(&mut attempt);
    assert_eq!(lived.len(), 5, "{lived:?}");
    let text = serde_json::to_vec(&attempt.episode()).unwrap();
    let tape = Tape::read(&text).unwrap();
    assert_eq!(tape, Tape::Episode(attempt.episode()));
    let mut again = tape.begin(&workcell, &object).unwrap();
    assert_eq!(phases(&mut again), lived);
    assert_eq!(again.episode(), attempt.episode(), "a recording of a recording");
    assert_eq!(again.motion(), attempt.motion());
}

#[test]
fn what_failed_before_the_lift_fails_at_the_same_tick() {
    // A recording without a lift stands for what collides on its way: only its verdict says so.
    let (workcell, object, mut attempt) = begin(0.8);
    for _ in 0..20 {
        attempt.tick(&workcell);
    }
    let verdict = Verdict::Failed { reason: Failure::Collided };
    let episode = Episode { verdict: Some(verdict), ..attempt.episode() };
    let mut again = episode.begin(&workcell, &object).unwrap();
    assert_eq!(again.run(&workcell), verdict);
    assert_eq!((again.ticks(), again.state_hash()), (20, attempt.state_hash()));
}

#[test]
fn a_changed_target_changes_the_end() {
    let (workcell, object, mut attempt) = begin(0.8);
    for _ in 0..20 {
        attempt.tick(&workcell);
    }
    let mut episode = attempt.episode();
    let (verdict, hash) = episode.replay(&workcell, &object).unwrap();
    assert_eq!((verdict, &hash), (None, &attempt.state_hash()), "it has come to nothing yet");
    episode.targets[10][0] += 1e-6;
    let (_, changed) = episode.replay(&workcell, &object).unwrap();
    assert_ne!(changed, hash);
}

#[test]
fn the_recording_that_the_page_begins_with_still_lifts() {
    let recording = include_str!("../../web/src/demo/recording.json");
    let recording: Demonstration = serde_json::from_str(recording).unwrap();
    let workcell = Workcell::new().unwrap();
    let object = Object::built_in(&recording.name).unwrap();
    let cure = "write it again: `ngf dataset episode DIR N --out web/src/demo/recording.json`";
    let mut attempt = recording.begin(&workcell, &object).expect(cure);
    assert!(attempt.run(&workcell).is_lifted());
}
