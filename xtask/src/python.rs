//! Python in an environment of its own, with the packages that the tests and the peers need.

use crate::place::{Place, read, run};
use crate::stamp::Step;
use anyhow::{Context, Result, bail};
use std::path::PathBuf;

/// The interpreter of an environment with the packages of `tests/python/<requirements>`, made where it is missing.
pub(crate) fn environment(place: &Place, requirements: &str) -> Result<PathBuf> {
    let wanted = place.root.join("tests/python").join(requirements);
    let name = wanted.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = place.target.join("python").join(&name);
    let bin = if cfg!(windows) { "Scripts" } else { "bin" };
    let python = folder.join(bin).join("python").with_extension(std::env::consts::EXE_EXTENSION);
    let step = Step { name: &name, inputs: vec![wanted.clone()], output: python.clone() };
    step.run(place, || {
        let base = interpreter(place)?;
        run(place.command(base, &["-m", "venv", "--clear"]).arg(&folder))
            .context("install Python's venv (on Debian: apt-get install python3-venv)")?;
        let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(place.command(&python, &pip).arg(&wanted))
    })?;
    Ok(python)
}

/// Least minor version of Python 3 that the packages run on.
const MINOR: u32 = 11;

fn interpreter(place: &Place) -> Result<&'static str> {
    for name in ["python3", "python"] {
        let asked = ["-c", "import sys; print(sys.version_info.major, sys.version_info.minor)"];
        let Ok(said) = read(&mut place.command(name, &asked)) else { continue };
        if suffices(&said) {
            return Ok(name);
        }
    }
    bail!("install Python 3.{MINOR} or newer")
}

fn suffices(version: &str) -> bool {
    let mut numbers = version.split(' ').map(str::parse::<u32>);
    matches!((numbers.next(), numbers.next()), (Some(Ok(3)), Some(Ok(minor))) if minor >= MINOR)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn python_is_new_enough_for_its_packages() {
        assert!(suffices("3 11") && suffices("3 14"));
        assert!(!suffices("3 10") && !suffices("2 7") && !suffices(""));
    }
}
