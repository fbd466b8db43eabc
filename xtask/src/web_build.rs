//! Web page build: Rust to WebAssembly, wasm-bindgen, then Vite, which also precompresses its output.

use crate::build_cache::{CachedStep, timed};
use crate::tools;
use crate::workspace::{Workspace, run};
use anyhow::Result;

/// Program that generates the bindings: `xtask/wasm-bindings`.
pub(crate) const GENERATOR: &str = "wasm-bindings";

/// Packages of the wasm modules, and the names of their bindings in `web/sim`. The second one is loaded with the
/// first mesh file.
const MODULES: [(&str, &str); 2] = [("wasm", "sim"), ("mesh-reader", "mesh_reader")];

/// Builds `web/dist` from [`MODULES`] and the sources in `web`.
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
    compile(workspace)?;
    generator()?;
    for (module, name) in MODULES {
        generate_bindings(workspace, module, name)?;
    }
    tools::npm_packages(workspace, "packages", &workspace.web())?;
    let page = CachedStep {
        name: "page",
        inputs: vec![workspace.web(), workspace.root.join("models")],
        output: workspace.web().join("dist/index.html"),
    };
    page.run(workspace, || run(&mut workspace.npm(&workspace.web(), &["run", "--silent", "build"])))
}

/// Builds the wasm modules. Not cached here, because cargo detects unchanged inputs.
fn compile(workspace: &Workspace) -> Result<()> {
    let mut args =
        vec!["build", "-q", "--target", "wasm32-unknown-unknown", "--profile", "wasm", "--lib"];
    for (package, _) in MODULES {
        args.extend(["-p", package]);
    }
    timed("wasm", || run(&mut workspace.cargo(&args)))
}

/// Writes the bindings of a module to `web/sim`.
fn generate_bindings(workspace: &Workspace, package: &str, name: &str) -> Result<()> {
    let file = format!("wasm32-unknown-unknown/wasm/{}.wasm", package.replace('-', "_"));
    let (wasm, folder) = (workspace.target.join(file), workspace.web().join("sim"));
    let (generator, label) = (workspace.program(GENERATOR), format!("bindings-{name}"));
    let bindings = CachedStep {
        name: &label,
        inputs: vec![generator.clone(), wasm.clone()],
        output: folder.join(format!("{name}.js")),
    };
    let mut command = workspace.command(generator, &[]);
    bindings.run(workspace, || run(command.arg(&wasm).arg(name).arg(&folder)))
}
