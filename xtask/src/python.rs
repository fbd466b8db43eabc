//! Python virtual environments with the packages of the tests and baselines.

use crate::build_cache::CachedStep;
use crate::workspace::{Workspace, output_of, run};
use anyhow::{Context, Result, bail};
use std::path::PathBuf;

/// Python interpreter of a virtual environment with the packages of `tests/python/<requirements>`. Creates
/// the environment if it is missing or outdated.
pub(crate) fn environment(workspace: &Workspace, requirements: &str) -> Result<PathBuf> {
    let file = workspace.root.join("tests/python").join(requirements);
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = workspace.target.join("python").join(&name);
    let bin = if cfg!(windows) { "Scripts" } else { "bin" };
    let python = folder.join(bin).join("python").with_extension(std::env::consts::EXE_EXTENSION);
    let step = CachedStep { name: &name, inputs: vec![file.clone()], output: python.clone() };
    step.run(workspace, || {
        let base = interpreter(workspace)?;
        run(workspace.command(base, &["-m", "venv", "--clear"]).arg(&folder))
            .context("install Python's venv (on Debian: apt-get install python3-venv)")?;
        let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(workspace.command(&python, &pip).arg(&file))
    })?;
    Ok(python)
}

/// Min. minor version of Python 3 that the packages support.
const MIN_MINOR: u32 = 11;

fn interpreter(workspace: &Workspace) -> Result<&'static str> {
    for name in ["python3", "python"] {
        let print_version =
            ["-c", "import sys; print(sys.version_info.major, sys.version_info.minor)"];
        let Ok(version) = output_of(&mut workspace.command(name, &print_version)) else { continue };
        if suffices(&version) {
            return Ok(name);
        }
    }
    bail!("no suitable Python found; install Python 3.{MIN_MINOR} or newer")
}

fn suffices(version: &str) -> bool {
    let mut numbers = version.split(' ').map(str::parse::<u32>);
    matches!((numbers.next(), numbers.next()), (Some(Ok(3)), Some(Ok(minor))) if minor >= MIN_MINOR)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn python_versions_match_the_support_of_the_packages() {
        assert!(suffices("3 11") && suffices("3 14"));
        assert!(!suffices("3 10") && !suffices("2 7") && !suffices(""));
    }
}
