//! The same attempt, bit for bit, in the browser as natively: `tests/tests/parity.rs` holds the native
//! side to the same file.

#![cfg(target_arch = "wasm32")]

use geometry::object::Object;
use rollout::{Attempt, Controller, Episode, Workcell};
use wasm_bindgen_test::{wasm_bindgen_test, wasm_bindgen_test_configure};

wasm_bindgen_test_configure!(run_in_dedicated_worker);

fn recorded() -> Episode {
    serde_json::from_str(include_str!("../../tests/golden/episode.json"))
        .expect("a recorded episode")
}

#[wasm_bindgen_test]
fn a_recorded_episode_ends_in_the_same_state() {
    let episode = recorded();
    let object = Object::built_in(&episode.name).expect("a built-in object");
    let workcell = Workcell::new().expect("a scene");
    let (verdict, hash) = episode.replay(&workcell, &object).expect("a replay");
    assert_eq!((verdict, hash), (episode.verdict, episode.state_hash));
}

#[wasm_bindgen_test]
fn an_attempt_from_its_seed_ends_in_the_same_state() {
    let episode = recorded();
    let object = Object::built_in(&episode.name).expect("a built-in object");
    let workcell = Workcell::new().expect("a scene");
    let (name, seed) = (episode.name.as_str(), episode.seed);
    let mut attempt = Attempt::begin(&workcell, &object, name, None, seed, Controller::Planner)
        .expect("an attempt");
    let verdict = attempt.run(&workcell);
    assert!(attempt.scene().steps() >= 1500, "{} physics steps", attempt.scene().steps());
    assert_eq!((Some(verdict), attempt.state_hash()), (episode.verdict, episode.state_hash));
}
