//! Timing of attempts in the browser (ms). `cargo xtask bench` parses the printed rows.

#![cfg(target_arch = "wasm32")]

use objects::object::Object;
use policy::NetworkInput;
use robot::JointState;
use rollout::{Attempt, Controller, Phase, RolloutContext};
use wasm_bindgen::JsCast;
use wasm_bindgen_test::{console_log, wasm_bindgen_test, wasm_bindgen_test_configure};
use web_sys::DedicatedWorkerGlobalScope;

wasm_bindgen_test_configure!(run_in_dedicated_worker);

const WEIGHTS: &[u8] = include_bytes!("../../models/default/weights.safetensors");
const STARTS: &[u8] = include_bytes!("../../models/default/start_configurations.safetensors");
const CONFIG: &[u8] = include_bytes!("../../models/default/config.json");

/// Number of attempts whose ticks are timed.
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
    let mut context = RolloutContext::new().expect("a scene");
    context.load_model(WEIGHTS, STARTS, CONFIG).expect("the model");
    let model = context.model.clone().expect("the model");
    // The bottle as an upload: convex parts from decomposition.
    let bottle = Object::from_catalog("bleach").expect("a built-in object");
    let parts = mesh::decompose(&bottle.mesh).hulls;
    let object = Object::new("bleach", bottle.mesh, true, parts, bottle.mass, 0.8).expect("parts");

    let mut ticks = Vec::new();
    for seed in 0..ATTEMPTS {
        let mut attempt = Attempt::new(&context, &object, "bleach", None, seed, Controller::Policy)
            .expect("an attempt");
        while attempt.outcome().is_none() {
            let start = now();
            attempt.step(&context);
            let elapsed = now() - start;
            if attempt.phase() == Phase::Policy && attempt.scene().contact_state().hand {
                ticks.push(elapsed);
            }
        }
    }
    // Timers in browsers are coarse, so ten steps are timed together.
    let state = JointState::at_rest(context.robot.nominal);
    let batch = [NetworkInput { state, latent: &[0.5; 32] }; 8];
    let ten_steps = |batch: &[NetworkInput]| {
        let start = now();
        for _ in 0..10 {
            std::hint::black_box(model.network.accelerations(batch));
        }
        (now() - start) / 10.0
    };
    row("policy_step_wasm", (0..30).map(|_| ten_steps(&batch[..1])).collect());
    row("policy_step_8_wasm", (0..30).map(|_| ten_steps(&batch)).collect());
    row("tick_wasm", ticks);
}
