//! What must be there before anything is built.

use crate::chromium;
use crate::place::{Place, read, run};
use crate::stamp::Step;
use anyhow::{Context, Result, bail};
use std::path::Path;
use std::process::Command;

/// Node releases that Vite runs on.
const NODE: &str = "^20.19 or >= 22.12";

/// The target of the worker's build; rustup fetches it where it is missing.
pub(crate) fn wasm_target(place: &Place) -> Result<()> {
    let sysroot = read(&mut place.command("rustc", &["--print", "sysroot"]))?;
    if Path::new(&sysroot).join("lib/rustlib/wasm32-unknown-unknown/lib").is_dir() {
        return Ok(());
    }
    run(&mut place.command("rustup", &["target", "add", "wasm32-unknown-unknown"]))
        .context("install rustup (https://rustup.rs), or the target wasm32-unknown-unknown")
}

/// A Node that is new enough.
pub(crate) fn node(place: &Place) -> Result<()> {
    let version = read(&mut place.command("node", &["--version"]))
        .with_context(|| format!("install Node {NODE} with npm"))?;
    if !node_suffices(&version) {
        bail!("Node {version} is too old: install Node {NODE}");
    }
    // Debian packs it apart from Node.
    read(&mut place.npm(&place.root, &["--version"]))
        .context("install npm (on Debian: apt-get install npm)")?;
    Ok(())
}

fn node_suffices(version: &str) -> bool {
    let mut numbers = version.trim_start_matches('v').split('.').map(|n| n.parse::<u32>());
    match (numbers.next(), numbers.next()) {
        (Some(Ok(20)), Some(Ok(minor))) => minor >= 19,
        (Some(Ok(22)), Some(Ok(minor))) => minor >= 12,
        (Some(Ok(major)), Some(Ok(_))) => major > 22,
        _ => false,
    }
}

/// The packages that a folder's lock file names.
pub(crate) fn npm_packages(place: &Place, name: &str, folder: &Path) -> Result<()> {
    let step = Step {
        name,
        inputs: vec![folder.join("package-lock.json"), folder.join("package.json")],
        output: folder.join("node_modules"),
    };
    step.run(place, || run(&mut place.npm(folder, &["ci", "--no-audit", "--no-fund"])))
}

/// A script of `tests/browser`, in Chromium and with the page that the built `ngf` serves.
pub(crate) fn browser(place: &Place, script: &str) -> Result<Command> {
    let chromium = chromium::find(place)?;
    let folder = place.browser_tests();
    npm_packages(place, "browser-packages", &folder)?;
    let mut npm = place.npm(&folder, &["run", "--silent", script]);
    npm.env("CHROMIUM", chromium.browser)
        .env("NGF", place.program("ngf"))
        .env("SCREENSHOTS", place.target.join("screenshots"));
    Ok(npm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_is_new_enough_for_vite() {
        for good in ["v20.19.0", "v20.20.2", "v22.12.0", "v24.0.0"] {
            assert!(node_suffices(good), "{good}");
        }
        for bad in ["v18.20.0", "v20.18.9", "v21.7.0", "v22.11.0", "", "v20"] {
            assert!(!node_suffices(bad), "{bad}");
        }
    }
}
