//! Parity of attempts with `models/default`: outcomes and final state hashes in the browser equal those of
//! the native build, bit for bit. `tests/tests/parity.rs` checks the native side against the same files.

#![cfg(target_arch = "wasm32")]

use objects::object::Object;
use rollout::{Attempt, Controller, Outcome, RolloutContext};
use wasm_bindgen_test::{console_log, wasm_bindgen_test, wasm_bindgen_test_configure};

wasm_bindgen_test_configure!(run_in_dedicated_worker);

const WEIGHTS: &[u8] = include_bytes!("../../models/default/weights.safetensors");
const STARTS: &[u8] = include_bytes!("../../models/default/start_configurations.safetensors");
const CONFIG: &[u8] = include_bytes!("../../models/default/config.json");

/// Output of `ngf evaluate --json`.
const REPORTS: [&str; 2] = [
    include_str!("../../tests/golden/attempts_sugar_box.json"),
    include_str!("../../tests/golden/attempts_bleach.json"),
];

/// Number of attempts per report that are repeated; `cargo xtask stress` repeats all of them.
fn attempts() -> usize {
    option_env!("NGF_ATTEMPTS").map_or(2, |number| number.parse().expect("a number"))
}

#[derive(serde::Deserialize)]
struct EvaluationReport {
    object: String,
    rows: Vec<AttemptResult>,
}

#[derive(serde::Deserialize)]
struct AttemptResult {
    seed: u64,
    outcome: Outcome,
    final_state_hash: String,
}

#[wasm_bindgen_test]
fn attempts_match_native_outcomes_and_hashes() {
    let mut context = RolloutContext::new().expect("a scene");
    context.load_model(WEIGHTS, STARTS, CONFIG).expect("the model");
    for report in REPORTS {
        let reports: Vec<EvaluationReport> = serde_json::from_str(report).expect("reports");
        let EvaluationReport { object: name, rows } = &reports[0];
        let object = Object::from_catalog(name).expect("a built-in object");
        let rows = &rows[..attempts().min(rows.len())];
        for AttemptResult { seed, outcome, final_state_hash } in rows {
            let controller = Controller::Policy;
            let mut attempt =
                Attempt::new(&context, &object, name, None, *seed, controller).expect("an attempt");
            let found = (attempt.run(&context), attempt.state_hash());
            assert_eq!(found, (*outcome, final_state_hash.clone()), "{name}, seed {seed}");
        }
        console_log!("{name}: {} of {} agree", rows.len(), rows.len());
    }
}
