//! Runs `wasm-bindgen` tests in a headless browser; cargo calls it with the built test.
//!
//! A program of its own, built only by `cargo xtask test`: the library behind it is heavy. Its
//! version is pinned beside that of `wasm-bindgen`, because the two must match exactly.

fn main() -> anyhow::Result<()> {
    wasm_bindgen_cli::wasm_bindgen_test_runner::run_cli_with_args(std::env::args_os())
}
