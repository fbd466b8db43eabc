//! Parity of a recorded attempt: the browser reproduces it bit for bit. `tests/tests/parity.rs` checks the
//! native side against the same file.

#![cfg(target_arch = "wasm32")]

use objects::object::Object;
use rollout::{Attempt, AttemptRecording, Controller, RolloutContext};
use wasm_bindgen_test::{wasm_bindgen_test, wasm_bindgen_test_configure};

wasm_bindgen_test_configure!(run_in_dedicated_worker);

fn recorded() -> AttemptRecording {
    serde_json::from_str(include_str!("../../tests/golden/episode.json")).expect("a recording")
}

#[wasm_bindgen_test]
fn replayed_recording_reproduces_final_state() {
    let recording = recorded();
    let object = Object::from_catalog(&recording.object_name).expect("a built-in object");
    let context = RolloutContext::new().expect("a scene");
    let (outcome, hash) = recording.replay(&context, &object).expect("a replay");
    assert_eq!((outcome, hash), (recording.outcome, recording.final_state_hash));
}

#[wasm_bindgen_test]
fn attempt_from_seed_reproduces_recording() {
    let recording = recorded();
    let object = Object::from_catalog(&recording.object_name).expect("a built-in object");
    let context = RolloutContext::new().expect("a scene");
    let (name, seed) = (recording.object_name.as_str(), recording.seed);
    let mut attempt =
        Attempt::new(&context, &object, name, None, seed, Controller::Planner).expect("an attempt");
    let outcome = attempt.run(&context);
    assert!(attempt.scene().steps() >= 1000, "{} physics steps", attempt.scene().steps());
    assert_eq!(
        (Some(outcome), attempt.state_hash()),
        (recording.outcome, recording.final_state_hash)
    );
}
