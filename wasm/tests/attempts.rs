//! Attempts of `models/default`, as the files beside `tests/golden/episode.json` have them: verdicts and final
//! hashes, bit for bit as natively. `tests/tests/parity.rs` holds the native side to the same files.

#![cfg(target_arch = "wasm32")]

use geometry::object::Object;
use rollout::{Attempt, Controller, Verdict, Workcell};
use wasm_bindgen_test::{console_log, wasm_bindgen_test, wasm_bindgen_test_configure};

wasm_bindgen_test_configure!(run_in_dedicated_worker);

const WEIGHTS: &[u8] = include_bytes!("../../models/default/weights.safetensors");
const STARTS: &[u8] = include_bytes!("../../models/default/starts.safetensors");
const CONFIG: &[u8] = include_bytes!("../../models/default/config.json");

/// What `ngf evaluate --json` wrote.
const REPORTS: [&str; 2] = [
    include_str!("../../tests/golden/attempts_sugar_box.json"),
    include_str!("../../tests/golden/attempts_bleach.json"),
];

/// Attempts of each report that are made again; `cargo xtask prove` makes all of them.
fn attempts() -> usize {
    option_env!("NGF_ATTEMPTS").map_or(2, |number| number.parse().expect("a number"))
}

#[derive(serde::Deserialize)]
struct Report {
    object: String,
    rows: Vec<Row>,
}

#[derive(serde::Deserialize)]
struct Row {
    seed: u64,
    verdict: Verdict,
    state_hash: String,
}

#[wasm_bindgen_test]
fn attempts_end_as_they_do_natively() {
    let mut workcell = Workcell::new().expect("a scene");
    workcell.load_model(WEIGHTS, STARTS, CONFIG).expect("the model");
    for report in REPORTS {
        let reports: Vec<Report> = serde_json::from_str(report).expect("reports");
        let Report { object: name, rows } = &reports[0];
        let object = Object::built_in(name).expect("a built-in object");
        let rows = &rows[..attempts().min(rows.len())];
        for Row { seed, verdict, state_hash } in rows {
            let controller = Controller::Policy;
            let mut attempt = Attempt::begin(&workcell, &object, name, None, *seed, controller)
                .expect("an attempt");
            let found = (attempt.run(&workcell), attempt.state_hash());
            assert_eq!(found, (*verdict, state_hash.clone()), "{name}, seed {seed}");
        }
        console_log!("{name}: {} of {} agree", rows.len(), rows.len());
    }
}
