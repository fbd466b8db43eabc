//! Native counterpart of `wasm/tests/parity.rs` and `wasm/tests/attempts.rs`, with the same recordings.
//!
//! A change of scene, robot, grasps or planner changes the recording. Regenerate it with
//! `ngf record --object sugar_box --seed 0 --out tests/golden/episode.json`.

use evaluation::{AttemptResult, EvaluationReport, evaluate};
use objects::object::Object;
use policy::model::MODEL_FILES;
use rollout::{Attempt, AttemptRecording, Controller, RolloutContext};
use std::ops::Range;
use std::path::Path;

#[test]
fn attempt_from_seed_and_replay_have_the_same_final_state() {
    let recording: AttemptRecording =
        serde_json::from_str(include_str!("../golden/episode.json")).unwrap();
    let object = Object::from_catalog(&recording.object_name).unwrap();
    let context = RolloutContext::new().unwrap();
    let (outcome, hash) = recording.replay(&context, &object).unwrap();
    assert_eq!((outcome, &hash), (recording.outcome, &recording.final_state_hash));

    let (name, seed) = (recording.object_name.as_str(), recording.seed);
    let mut attempt =
        Attempt::new(&context, &object, name, None, seed, Controller::Planner).unwrap();
    let outcome = attempt.run(&context);
    assert!(attempt.scene().steps() >= 1000, "{} physics steps", attempt.scene().steps());
    assert_eq!(
        (Some(outcome), attempt.state_hash()),
        (recording.outcome, recording.final_state_hash)
    );
}

/// Reports of `models/default`: `ngf evaluate --model default --object NAME --attempts 50 --json FILE`.
const REPORTS: [&str; 2] = [
    include_str!("../golden/attempts_sugar_box.json"),
    include_str!("../golden/attempts_bleach.json"),
];

/// Seeds that are repeated: one attempt alone, and seven in lockstep.
const SEEDS: [Range<u64>; 2] = [0..1, 1..8];

#[test]
fn default_model_reproduces_its_recorded_attempts_in_any_batch() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default");
    let read = |file: &str| std::fs::read(folder.join(file)).unwrap();
    let files = MODEL_FILES.map(|(_, file)| read(file));
    let mut context = RolloutContext::new().unwrap();
    let hash = context.load_model(&files[0], &files[1], &files[2]).unwrap();
    for report in REPORTS {
        let reports: Vec<EvaluationReport> = serde_json::from_str(report).unwrap();
        let report = &reports[0];
        assert_eq!(report.model_hash.as_ref(), Some(&hash), "regenerate the reports");
        assert_eq!(report.attempts, 50);
        let object = Object::from_catalog(&report.object).unwrap();
        let (name, controller) = (&report.object, Controller::Policy);
        let run = |seeds: Range<u64>| {
            evaluate(&context, &object, name, &controller, None, seeds, &|_| Ok(())).unwrap().rows
        };
        for (found, wanted) in SEEDS.into_iter().flat_map(run).zip(&report.rows) {
            let end = |row: &AttemptResult| (row.seed, row.outcome, row.final_state_hash.clone());
            assert_eq!(end(&found), end(wanted), "{name}");
        }
    }
}
