//! Tools that must be installed before a build.

use crate::build_cache::CachedStep;
use crate::chromium;
use crate::workspace::{Workspace, output_of, run};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Node versions that Vite supports.
const NODE: &str = "^20.19 or >= 22.12";

/// Installs the wasm target with rustup if it is missing.
pub(crate) fn wasm_target(workspace: &Workspace) -> Result<()> {
    let sysroot = output_of(&mut workspace.command("rustc", &["--print", "sysroot"]))?;
    if Path::new(&sysroot).join("lib/rustlib/wasm32-unknown-unknown/lib").is_dir() {
        return Ok(());
    }
    run(&mut workspace.command("rustup", &["target", "add", "wasm32-unknown-unknown"])).context(
        "cannot add the target; install rustup (https://rustup.rs) or wasm32-unknown-unknown",
    )
}

/// cargo-deny, which checks licences and sources of third-party crates.
pub(crate) fn cargo_deny(workspace: &Workspace) -> Result<PathBuf> {
    installed(workspace, "cargo-deny", "0.20.2")
}

/// The WebDriver of Firefox.
pub(crate) fn geckodriver(workspace: &Workspace) -> Result<PathBuf> {
    installed(workspace, "geckodriver", "0.37.1")
}

/// Program of a crate, built below the target folder if it is missing.
fn installed(workspace: &Workspace, name: &str, version: &str) -> Result<PathBuf> {
    let folder = workspace.target.join("tools").join(format!("{name}-{version}"));
    let program = folder.join("bin").join(name).with_extension(std::env::consts::EXE_EXTENSION);
    if !program.exists() {
        // Unoptimised: the build takes longer than all runs.
        let install = ["install", name, "--version", version, "--locked", "--debug"];
        let mut cargo = workspace.cargo(&install);
        run(cargo.arg("--quiet").arg("--root").arg(&folder))
            .with_context(|| format!("cannot install {name}"))?;
    }
    Ok(program)
}

/// Checks that a supported Node and npm are installed.
pub(crate) fn node(workspace: &Workspace) -> Result<()> {
    let version = output_of(&mut workspace.command("node", &["--version"]))
        .with_context(|| format!("install Node {NODE} with npm"))?;
    if !node_suffices(&version) {
        bail!("Node {version} is not supported; install Node {NODE}");
    }
    // On Debian, npm is a separate package.
    output_of(&mut workspace.npm(&workspace.root, &["--version"]))
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

/// Installs the npm packages of the lock file in `folder`.
pub(crate) fn npm_packages(workspace: &Workspace, name: &str, folder: &Path) -> Result<()> {
    let step = CachedStep {
        name,
        inputs: vec![folder.join("package-lock.json"), folder.join("package.json")],
        output: folder.join("node_modules"),
    };
    step.run(workspace, || run(&mut workspace.npm(folder, &["ci", "--no-audit", "--no-fund"])))
}

/// Checks that the page's types match the OpenAPI description. The generator needs an older TypeScript than the
/// page, so it is a package of `tests/browser`.
pub(crate) fn check_api_types(workspace: &Workspace) -> Result<()> {
    let folder = workspace.browser_tests();
    npm_packages(workspace, "browser-packages", &folder)?;
    let check = ["run", "--silent", "api-types", "--", "--check"];
    run(&mut workspace.npm(&folder, &check)).context(
        "web/src/common/api_types.ts differs from server/openapi.json; run `npm run api-types` in tests/browser",
    )
}

/// An npm script of `tests/browser`, with Chromium and the page served by the built `ngf`.
pub(crate) fn browser(workspace: &Workspace, script: &str) -> Result<Command> {
    let chromium = chromium::find(workspace)?;
    let folder = workspace.browser_tests();
    npm_packages(workspace, "browser-packages", &folder)?;
    let mut npm = workspace.npm(&folder, &["run", "--silent", script]);
    npm.env("CHROMIUM", chromium.browser)
        .env("NGF", workspace.program("ngf"))
        .env("SCREENSHOTS", workspace.target.join("screenshots"));
    Ok(npm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_versions_match_the_support_of_vite() {
        for good in ["v20.19.0", "v20.20.2", "v22.12.0", "v24.0.0"] {
            assert!(node_suffices(good), "{good}");
        }
        for bad in ["v18.20.0", "v20.18.9", "v21.7.0", "v22.11.0", "", "v20"] {
            assert!(!node_suffices(bad), "{bad}");
        }
    }
}
