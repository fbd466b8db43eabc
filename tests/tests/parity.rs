//! The native side of `wasm/tests/parity.rs` and `wasm/tests/attempts.rs`: both are held to what is recorded.
//!
//! A change of scene, robot, grasps or planner changes the recording; it is made anew by
//! `ngf replay tests/golden/episode.json --record sugar_box --seed 0`.

use geometry::object::Object;
use imitation::evaluation::{Report, Row, evaluate};
use rollout::{Attempt, Controller, Episode, Workcell};
use std::path::Path;

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

/// Reports of `models/default`, written by `ngf evaluate --model default --object NAME --attempts 50 --json FILE`.
const REPORTS: [&str; 2] = [
    include_str!("../golden/attempts_sugar_box.json"),
    include_str!("../golden/attempts_bleach.json"),
];

/// Attempts of each report that are made again here.
const ATTEMPTS: usize = 2;

#[test]
fn attempts_of_the_default_model_end_as_they_did() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default");
    let read = |file: &str| std::fs::read(folder.join(file)).unwrap();
    let files = ["weights.safetensors", "starts.safetensors", "config.json"].map(read);
    let mut workcell = Workcell::new().unwrap();
    let hash = workcell.load_model(&files[0], &files[1], &files[2]).unwrap();
    for report in REPORTS {
        let reports: Vec<Report> = serde_json::from_str(report).unwrap();
        let report = &reports[0];
        assert_eq!(report.model_hash.as_ref(), Some(&hash), "make the reports again");
        assert_eq!(report.attempts, 50);
        let object = Object::built_in(&report.object).unwrap();
        let seeds = 0..ATTEMPTS as u64;
        let controller = Controller::Policy;
        let name = &report.object;
        let found =
            evaluate(&workcell, &object, name, &controller, None, seeds, &|_| Ok(())).unwrap();
        for (found, wanted) in found.rows.iter().zip(&report.rows) {
            let end = |row: &Row| (row.seed, row.verdict, row.state_hash.clone());
            assert_eq!(end(found), end(wanted), "{name}");
        }
    }
}
