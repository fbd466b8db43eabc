//! Generates the JavaScript bindings of the wasm module: `wasm-bindings MODULE.wasm FOLDER`.
//!
//! A program of its own, because its dependencies take longer to compile than all of `xtask`.

use anyhow::{Result, bail};
use wasm_bindgen_cli_support::Bindgen;

/// Writes `sim.js` and `sim_bg.wasm`. The caller of the ES module passes the URL of the wasm file.
fn main() -> Result<()> {
    let args: Vec<_> = std::env::args_os().skip(1).collect();
    let [module, folder] = &args[..] else { bail!("usage: wasm-bindings MODULE.wasm FOLDER") };
    Bindgen::new()
        .input_path(module)
        .out_name("sim")
        .web(true)?
        .typescript(true)
        .omit_default_module_path(true)
        .remove_name_section(true)
        .remove_producers_section(true)
        .generate(folder)
}
