//! Milliseconds of an attempt in the browser: rows for `cargo xtask bench`, which reads them from what is
//! printed here.

#![cfg(target_arch = "wasm32")]

use geometry::mesh;
use geometry::object::Object;
use robot::JointState;
use rollout::{Attempt, Controller, Phase, Workcell};
use scene::Simulation;
use wasm_bindgen::JsCast;
use wasm_bindgen_test::{console_log, wasm_bindgen_test, wasm_bindgen_test_configure};
use web_sys::DedicatedWorkerGlobalScope;

wasm_bindgen_test_configure!(run_in_dedicated_worker);

const WEIGHTS: &[u8] = include_bytes!("../../models/default/weights.safetensors");
const STARTS: &[u8] = include_bytes!("../../models/default/starts.safetensors");
const CONFIG: &[u8] = include_bytes!("../../models/default/config.json");

/// Attempts whose ticks are timed.
const ATTEMPTS: u64 = 5;

fn now() -> f64 {
    let scope: DedicatedWorkerGlobalScope = js_sys::global().unchecked_into();
    scope.performance().expect("a clock").now()
}

fn row(name: &str, mut times: Vec<f64>) {
    times.sort_by(f64::total_cmp);
    assert!(times.len() >= 20, "{name}: {} measurements", times.len());
    console_log!("row {name} {:.4} ms", times[times.len() / 2]);
}

#[wasm_bindgen_test]
fn rows() {
    let mut workcell = Workcell::new().expect("a scene");
    workcell.load_model(WEIGHTS, STARTS, CONFIG).expect("the model");
    let model = workcell.model.clone().expect("the model");
    // As an upload: the mesh of the bottle, split into convex parts.
    let bottle = Object::built_in("bleach").expect("a built-in object");
    let parts = mesh::convex_parts_or_hull(&bottle.mesh).hulls;
    let object = Object::new("bleach", bottle.mesh, true, parts, bottle.mass, 0.8).expect("parts");

    let (mut steps, mut ticks) = (Vec::new(), Vec::new());
    for seed in 0..ATTEMPTS {
        let mut attempt =
            Attempt::begin(&workcell, &object, "bleach", None, seed, Controller::Policy)
                .expect("an attempt");
        while attempt.verdict().is_none() {
            let begin = now();
            attempt.tick(&workcell);
            let took = now() - begin;
            if attempt.phase() == Phase::Policy && attempt.scene().touching().hand {
                ticks.push(took);
            }
        }
    }
    // The clock of a browser is coarse: ten steps at a time.
    let state = JointState::at_rest(workcell.robot.nominal);
    for _ in 0..30 {
        let begin = now();
        for _ in 0..10 {
            std::hint::black_box(model.network.acceleration(&state, &[0.5; 32]));
        }
        steps.push((now() - begin) / 10.0);
    }
    row("policy_step_wasm", steps);
    row("tick_wasm", ticks);
}
