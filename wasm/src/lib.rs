//! The worker in the browser: the page's messages in, what happens out.
//!
//! A thin layer over `rollout`. It fetches the weights, keeps the clock, finds the words, and counts;
//! it knows nothing of the page but its protocol.

mod batch;
mod clock;
mod fetch;
mod history;
mod likeness;
mod look;
mod protocol;
mod stage;
mod statistics;
mod upload;
mod worker;

use wasm_bindgen::prelude::wasm_bindgen;

/// Answers messages from now on, and says `ready`.
#[wasm_bindgen]
pub fn start() {
    worker::start();
}

#[cfg(test)]
wasm_bindgen_test::wasm_bindgen_test_configure!(run_in_dedicated_worker);
