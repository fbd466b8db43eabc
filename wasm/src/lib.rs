//! Web Worker of the demo page.
//!
//! In: requests of the page. Out: events. A thin layer over `rollout` that loads the model, paces the
//! simulation, generates texts and counts outcomes. It depends on the page only through the message protocol.

mod batch;
mod clock;
mod familiarity_text;
mod fetch;
mod history;
mod object_import;
mod outcome_text;
mod protocol;
mod robot_visuals;
mod session;
mod statistics;
mod worker;
mod worker_scope;

use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

/// Sets up the session and posts `ready`.
#[wasm_bindgen]
pub fn start() {
    worker::start();
}

/// Executes a request of the page, after [`start`].
#[wasm_bindgen]
pub fn receive(message: &JsValue) {
    worker::receive(message);
}

#[cfg(test)]
wasm_bindgen_test::wasm_bindgen_test_configure!(run_in_dedicated_worker);
