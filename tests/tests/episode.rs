//! An attempt is recorded, travels as JSON, and replays to the same bits.

use geometry::object::Object;
use rollout::{Attempt, Controller, Episode, Workcell};

#[test]
fn an_episode_replays_to_its_own_hash_and_is_refused_elsewhere() {
    let workcell = Workcell::new().unwrap();
    let object = Object::built_in("sugar_box").unwrap();
    let planner = Controller::Planner;
    let mut attempt = Attempt::begin(&workcell, &object, "sugar_box", None, 0, planner).unwrap();
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
    let message = refusal(read, &object.with_friction(0.5));
    assert!(message.contains("another object"), "{message}");
}

#[test]
fn a_changed_target_changes_the_end() {
    let workcell = Workcell::new().unwrap();
    let object = Object::built_in("sugar_box").unwrap();
    let planner = Controller::Planner;
    let mut attempt = Attempt::begin(&workcell, &object, "sugar_box", None, 0, planner).unwrap();
    for _ in 0..20 {
        attempt.tick(&workcell);
    }
    let mut episode = attempt.episode();
    let (_, hash) = episode.replay(&workcell, &object).unwrap();
    assert_eq!(hash, attempt.state_hash());
    episode.targets[10][0] += 1e-6;
    let (_, changed) = episode.replay(&workcell, &object).unwrap();
    assert_ne!(changed, hash);
}
