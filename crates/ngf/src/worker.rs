//! The worker executable, which contains all commands except `serve`.

use anyhow::{Context, bail};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

/// Name of the worker executable. It is in the folder of this executable.
const WORKER: &str = "ngf-worker";

/// Path of the worker executable, whether or not it exists.
pub(crate) fn path() -> anyhow::Result<PathBuf> {
    let own = std::env::current_exe().context("cannot locate this executable")?;
    Ok(own.with_file_name(format!("{WORKER}{}", std::env::consts::EXE_SUFFIX)))
}

/// Path of the worker executable; fails if it does not exist.
pub(crate) fn executable() -> anyhow::Result<PathBuf> {
    let worker = path()?;
    if !worker.is_file() {
        bail!("{} does not exist; build it with `cargo build --bin ngf-worker`", worker.display());
    }
    Ok(worker)
}

/// Replaces this process by the worker executable with these arguments.
#[cfg(unix)]
pub(crate) fn run(args: &[OsString]) -> anyhow::Result<()> {
    use std::os::unix::process::CommandExt;
    let worker = executable()?;
    let error = Command::new(&worker).args(args).exec();
    Err(error).with_context(|| format!("cannot start {}", worker.display()))
}

/// Runs the worker executable with these arguments and exits with its status.
#[cfg(not(unix))]
pub(crate) fn run(args: &[OsString]) -> anyhow::Result<()> {
    let worker = executable()?;
    let status = Command::new(&worker).args(args).status();
    let status = status.with_context(|| format!("cannot start {}", worker.display()))?;
    std::process::exit(status.code().unwrap_or(2));
}
