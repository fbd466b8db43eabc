//! Python virtual environments with the packages of the tests and baselines.

use crate::build_cache::CachedStep;
use crate::workspace::{Workspace, output_of, run};
use anyhow::{Context, Result, bail};
use std::path::PathBuf;

/// Packages of a file in `tests/python`.
#[derive(Clone, Copy)]
pub(crate) struct Requirements {
    /// Name of the file.
    pub(crate) file: &'static str,
    /// Min. minor version of Python 3 that the packages support.
    pub(crate) min_minor: u32,
}

/// Packages of the tests, of the checks of the API, and of the benchmarks.
pub(crate) const TEST: Requirements = Requirements { file: "requirements.txt", min_minor: 11 };
pub(crate) const API: Requirements = Requirements { file: "api.txt", min_minor: 11 };
pub(crate) const LINTS: Requirements = Requirements { file: "lints.txt", min_minor: 11 };
pub(crate) const BASELINES: Requirements = Requirements { file: "baselines.txt", min_minor: 11 };
pub(crate) const CLIENTS: Requirements = Requirements { file: "clients.txt", min_minor: 11 };
pub(crate) const LEROBOT: Requirements = Requirements { file: "lerobot.txt", min_minor: 12 };

/// Python interpreter of a virtual environment with these packages. Creates the environment if it is missing
/// or outdated.
pub(crate) fn environment(workspace: &Workspace, requirements: Requirements) -> Result<PathBuf> {
    let file = workspace.root.join("tests/python").join(requirements.file);
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = workspace.target.join("python").join(&name);
    let bin = if cfg!(windows) { "Scripts" } else { "bin" };
    let python = folder.join(bin).join("python").with_extension(std::env::consts::EXE_EXTENSION);
    let step = CachedStep { name: &name, inputs: vec![file.clone()], output: python.clone() };
    step.run(workspace, || {
        let base = interpreter(workspace, requirements.min_minor)?;
        run(workspace.command(base, &["-m", "venv", "--clear"]).arg(&folder))
            .context("install Python's venv (on Debian: apt-get install python3-venv)")?;
        let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(workspace.command(&python, &pip).arg(&file))
    })?;
    Ok(python)
}

/// Environment variable that names another interpreter than the one on the path.
const PYTHON_ENV: &str = "NGF_PYTHON";

fn interpreter(workspace: &Workspace, min_minor: u32) -> Result<String> {
    let names = ["python3", "python", "python3.12", "python3.13", "python3.14"].map(str::to_owned);
    for name in std::env::var(PYTHON_ENV).into_iter().chain(names) {
        let print_version =
            ["-c", "import sys; print(sys.version_info.major, sys.version_info.minor)"];
        let Ok(version) = output_of(&mut workspace.command(&name, &print_version)) else {
            continue;
        };
        if suffices(&version, min_minor) {
            return Ok(name);
        }
    }
    bail!(
        "install Python 3.{min_minor} or newer, or set {PYTHON_ENV} to the path of its interpreter"
    )
}

fn suffices(version: &str, min_minor: u32) -> bool {
    let mut numbers = version.split(' ').map(str::parse::<u32>);
    matches!((numbers.next(), numbers.next()), (Some(Ok(3)), Some(Ok(minor))) if minor >= min_minor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn python_versions_match_the_support_of_the_packages() {
        assert!(suffices("3 11", 11) && suffices("3 14", 12));
        assert!(!suffices("3 11", 12) && !suffices("2 7", 11) && !suffices("", 11));
    }
}
