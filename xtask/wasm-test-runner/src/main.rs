//! Runner for `wasm-bindgen` tests in a headless browser; cargo calls it with the built test.
//!
//! Its version is pinned together with `wasm-bindgen`, because the two must match exactly.

fn main() -> anyhow::Result<()> {
    wasm_bindgen_cli::wasm_bindgen_test_runner::run_cli_with_args(std::env::args_os())
}
