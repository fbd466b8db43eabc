//! The environment that training needs, which a process has from its beginning or not at all.

use anyhow::{Context, Result, bail};
use std::process::Command;

/// Matrix products stay on the thread of their shard; memory that is freed is kept, for a step frees
/// and takes hundreds of megabytes (6.0 against 2.6 steps/s).
const ENVIRONMENT: [(&str, &str); 4] = [
    ("RAYON_NUM_THREADS", "1"),
    ("MALLOC_MMAP_THRESHOLD_", "4294967296"),
    ("MALLOC_TRIM_THRESHOLD_", "8589934592"),
    ("MALLOC_TOP_PAD_", "268435456"),
];

/// Runs this program again in that environment, if it is not in it; says whether it did.
pub(crate) fn run_again() -> Result<bool> {
    if ENVIRONMENT.iter().all(|(name, value)| std::env::var(name).as_deref() == Ok(value)) {
        return Ok(false);
    }
    let program = std::env::current_exe().context("where this program is")?;
    let mut again = Command::new(program);
    again.args(std::env::args_os().skip(1)).envs(ENVIRONMENT);
    match again.status()?.code() {
        Some(0) => Ok(true),
        // It has said why.
        Some(code) => std::process::exit(code),
        None => bail!("training was stopped; run the same command again to continue it"),
    }
}
