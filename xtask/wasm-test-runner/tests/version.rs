//! The runner starts. As an integration test, it also makes `cargo test --workspace` build the runner with the
//! dependencies of the other tests, so that the browser tests need no build of their own.

use std::process::Command;

#[test]
fn runner_prints_its_help() {
    let output = Command::new(env!("CARGO_BIN_EXE_wasm-test-runner")).arg("--help").output();
    let output = output.expect("the runner starts");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("wasm-bindgen"), "{text}");
}
