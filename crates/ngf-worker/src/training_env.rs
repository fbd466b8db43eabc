//! Environment variables of training, which must be set when the process starts.

use anyhow::{Context, Result};
use std::process::Command;

/// Matrix products stay on the calling thread. Freed memory is kept, because a step frees and allocates
/// hundreds of megabytes (6.0 instead of 2.6 steps/s). Huge pages are used if the system provides them.
const TRAINING_VARIABLES: [(&str, &str); 5] = [
    ("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1"),
    ("RAYON_NUM_THREADS", "1"),
    ("MALLOC_MMAP_THRESHOLD_", "4294967296"),
    ("MALLOC_TRIM_THRESHOLD_", "8589934592"),
    ("MALLOC_TOP_PAD_", "268435456"),
];

/// Re-executes this program with these variables unless they are already set. On Unix the process is
/// replaced, so that a signal to it stops the training.
pub(crate) fn reexec() -> Result<()> {
    if TRAINING_VARIABLES.iter().all(|(name, value)| std::env::var(name).as_deref() == Ok(value)) {
        return Ok(());
    }
    let program = std::env::current_exe().context("cannot locate this executable")?;
    let mut command = Command::new(program);
    command.args(std::env::args_os().skip(1)).envs(TRAINING_VARIABLES);
    replace(command)
}

#[cfg(unix)]
fn replace(mut command: Command) -> Result<()> {
    use std::os::unix::process::CommandExt;
    Err(command.exec()).context("cannot re-execute this program")
}

#[cfg(not(unix))]
fn replace(mut command: Command) -> Result<()> {
    // The child process has printed its own error.
    std::process::exit(command.status()?.code().unwrap_or(2))
}
