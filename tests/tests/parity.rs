//! The native side of `wasm/tests/parity.rs`: both are held to the recorded episode.
//!
//! A change of scene, robot, grasps or planner changes the recording; it is made anew by
//! `ngf replay tests/golden/episode.json --record sugar_box --seed 0`.

use geometry::object::Object;
use rollout::{Attempt, Controller, Episode, Workcell};

#[test]
fn an_attempt_from_its_seed_and_its_recording_end_in_the_same_state() {
    let episode: Episode = serde_json::from_str(include_str!("../golden/episode.json")).unwrap();
    let object = Object::built_in(&episode.name).unwrap();
    let workcell = Workcell::new().unwrap();
    let (verdict, hash) = episode.replay(&workcell, &object).unwrap();
    assert_eq!((verdict, &hash), (episode.verdict, &episode.state_hash));

    let (name, seed) = (episode.name.as_str(), episode.seed);
    let mut attempt =
        Attempt::begin(&workcell, &object, name, None, seed, Controller::Planner).unwrap();
    let verdict = attempt.run(&workcell);
    assert!(attempt.scene().steps() >= 1500, "{} physics steps", attempt.scene().steps());
    assert_eq!((Some(verdict), attempt.state_hash()), (episode.verdict, episode.state_hash));
}
