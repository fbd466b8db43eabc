//! Web page build: Rust to WebAssembly, wasm-bindgen, then Vite, which also precompresses its output.

use crate::build_cache::{CachedStep, timed};
use crate::tools;
use crate::workspace::{Workspace, run};
use anyhow::Result;

/// Program that generates the bindings: `xtask/wasm-bindings`.
pub(crate) const GENERATOR: &str = "wasm-bindings";

/// Builds `web/dist` from crate `wasm` and the sources in `web`.
pub(crate) fn build(workspace: &Workspace) -> Result<()> {
    build_with(workspace, || workspace.build_programs(&[GENERATOR]))
}

/// Builds the page; `generator` builds [`GENERATOR`] or waits until it is built.
pub(crate) fn build_with(
    workspace: &Workspace,
    generator: impl FnOnce() -> Result<()>,
) -> Result<()> {
    tools::node(workspace)?;
    tools::wasm_target(workspace)?;
    let wasm = compile(workspace)?;
    let sim = workspace.web().join("sim");
    generator()?;
    let generator = workspace.program(GENERATOR);
    let bindings = CachedStep {
        name: "bindings",
        inputs: vec![generator.clone(), wasm.clone()],
        output: sim.clone(),
    };
    bindings.run(workspace, || run(workspace.command(generator, &[]).args([&wasm, &sim])))?;
    tools::npm_packages(workspace, "packages", &workspace.web())?;
    let page = CachedStep {
        name: "page",
        inputs: vec![workspace.web(), workspace.root.join("models")],
        output: workspace.web().join("dist/index.html"),
    };
    page.run(workspace, || run(&mut workspace.npm(&workspace.web(), &["run", "--silent", "build"])))
}

/// Builds the wasm module. Not cached here, because cargo detects unchanged inputs.
fn compile(workspace: &Workspace) -> Result<std::path::PathBuf> {
    let args =
        ["build", "-q", "-p", "wasm", "--target", "wasm32-unknown-unknown", "--profile", "wasm"];
    timed("wasm", || run(&mut workspace.cargo(&args)))?;
    Ok(workspace.target.join("wasm32-unknown-unknown/wasm/wasm.wasm"))
}
