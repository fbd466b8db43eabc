//! The controls are what they are called.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use geometry::object::Object;
use robot::ARM;
use rollout::{Attempt, Controller, Workcell};
use std::path::Path;

#[test]
fn without_a_policy_fingers_close_and_the_arm_rests() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default");
    let read = |file: &str| std::fs::read(folder.join(file)).unwrap();
    let [weights, starts, config] =
        ["weights.safetensors", "starts.safetensors", "config.json"].map(read);
    let mut workcell = Workcell::new().unwrap();
    workcell.load_model(&weights, &starts, &config).unwrap();
    let object = Object::built_in("sugar_box").unwrap();
    let mut attempt =
        Attempt::begin(&workcell, &object, "sugar_box", None, 0, Controller::Script).unwrap();
    attempt.run(&workcell);
    let episode = attempt.episode();
    let (from, to) = (episode.policy_tick.unwrap(), episode.lift_tick.unwrap());
    let (first, last) = (&episode.targets[from], &episode.targets[to]);
    for row in &episode.targets[from..=to] {
        assert_eq!(row[..ARM], first[..ARM], "the arm moved");
    }
    assert!((last[ARM + 1] - first[ARM + 1]).abs() > 0.3, "the fingers did not close");
}
