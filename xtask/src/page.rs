//! The page: Rust to WebAssembly, bindings, then Vite (which also compresses what it wrote).

use crate::place::{Place, run};
use crate::stamp::{Step, timed};
use crate::tools;
use anyhow::Result;
use std::path::Path;
use wasm_bindgen_cli_support::Bindgen;

/// Builds `web/dist` from the worker's crate and the page's sources.
pub(crate) fn build(place: &Place) -> Result<()> {
    tools::node(place)?;
    tools::wasm_target(place)?;
    let wasm = compile(place)?;
    let engine = place.web().join("engine");
    let bindings = Step { name: "bindings", inputs: vec![wasm.clone()], output: engine.clone() };
    bindings.run(place, || bind(&wasm, &engine))?;
    tools::npm_packages(place, "packages", &place.web())?;
    let page = Step {
        name: "page",
        inputs: vec![place.web(), place.root.join("models")],
        output: place.web().join("dist/index.html"),
    };
    page.run(place, || run(&mut place.npm(&place.web(), &["run", "--silent", "build"])))
}

/// Cargo knows best whether there is anything to do.
fn compile(place: &Place) -> Result<std::path::PathBuf> {
    let args =
        ["build", "-q", "-p", "wasm", "--target", "wasm32-unknown-unknown", "--profile", "wasm"];
    timed("engine", || run(&mut place.cargo(&args)))?;
    Ok(place.target.join("wasm32-unknown-unknown/wasm/wasm.wasm"))
}

/// Writes `engine.js` and `engine_bg.wasm`: ES modules that are given the address of the wasm file.
fn bind(wasm: &Path, engine: &Path) -> Result<()> {
    Bindgen::new()
        .input_path(wasm)
        .out_name("engine")
        .web(true)?
        .typescript(true)
        .omit_default_module_path(true)
        .remove_name_section(true)
        .remove_producers_section(true)
        .generate(engine)
}
