//! Generates the JavaScript bindings of a wasm module: `wasm-bindings MODULE.wasm NAME FOLDER`.
//!
//! A program of its own, because its dependencies take longer to compile than all of `xtask`.

use anyhow::{Result, bail};
use wasm_bindgen_cli_support::Bindgen;

/// Writes `NAME.js` and `NAME_bg.wasm`. The caller of the ES module passes the URL of the wasm file.
fn main() -> Result<()> {
    let args: Vec<_> = std::env::args_os().skip(1).collect();
    let [module, name, folder] = &args[..] else {
        bail!("usage: wasm-bindings MODULE.wasm NAME FOLDER")
    };
    let Some(name) = name.to_str() else { bail!("{name:?} is not a name") };
    Bindgen::new()
        .input_path(module)
        .out_name(name)
        .web(true)?
        .typescript(true)
        .omit_default_module_path(true)
        .remove_name_section(true)
        .remove_producers_section(true)
        .generate(folder)
}
