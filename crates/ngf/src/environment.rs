//! The environment that training needs, which a process has from its beginning or not at all.

use anyhow::{Context, Result};
use std::process::Command;

/// Matrix products stay on the thread that asks for them; memory that is freed is kept, for a step frees
/// and takes hundreds of megabytes (6.0 against 2.6 steps/s), and lies on huge pages, where the system gives them.
const ENVIRONMENT: [(&str, &str); 5] = [
    ("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1"),
    ("RAYON_NUM_THREADS", "1"),
    ("MALLOC_MMAP_THRESHOLD_", "4294967296"),
    ("MALLOC_TRIM_THRESHOLD_", "8589934592"),
    ("MALLOC_TOP_PAD_", "268435456"),
];

/// Begins this program anew in that environment, if it is not in it. Where processes can be replaced, this one is:
/// whoever stops it stops the training.
pub(crate) fn begin_anew() -> Result<()> {
    if ENVIRONMENT.iter().all(|(name, value)| std::env::var(name).as_deref() == Ok(value)) {
        return Ok(());
    }
    let program = std::env::current_exe().context("where this program is")?;
    let mut anew = Command::new(program);
    anew.args(std::env::args_os().skip(1)).envs(ENVIRONMENT);
    replace(anew)
}

#[cfg(unix)]
fn replace(mut anew: Command) -> Result<()> {
    use std::os::unix::process::CommandExt;
    Err(anew.exec()).context("cannot begin anew")
}

#[cfg(not(unix))]
fn replace(mut anew: Command) -> Result<()> {
    // It has said why it failed.
    std::process::exit(anew.status()?.code().unwrap_or(2))
}
