//! Build cache: steps that are skipped if their inputs are unchanged.

use crate::workspace::Workspace;
use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A build step with its inputs and output.
pub(crate) struct CachedStep<'a> {
    /// Label for the log ("page: 2.1 s") and name of the stamp file.
    pub(crate) name: &'a str,
    /// Input files, and folders with all files below them.
    pub(crate) inputs: Vec<PathBuf>,
    /// Output path; if it does not exist, the step runs.
    pub(crate) output: PathBuf,
}

/// Generated folders, excluded from the inputs.
const GENERATED: [&str; 2] = ["node_modules", "dist"];

impl CachedStep<'_> {
    /// Runs `work` unless it was completed with the same inputs before.
    pub(crate) fn run(
        &self,
        workspace: &Workspace,
        work: impl FnOnce() -> Result<()>,
    ) -> Result<()> {
        let stamp = workspace.target.join("xtask").join(format!("{}.stamp", self.name));
        let hash = self.hash()?;
        if self.output.exists() && fs::read_to_string(&stamp).is_ok_and(|stored| stored == hash) {
            return Ok(());
        }
        // The stamp is written only after completion, so an interrupted step runs again.
        fs::remove_file(&stamp).ok();
        timed(self.name, work)?;
        fs::create_dir_all(stamp.parent().context("the stamp path has no parent folder")?)?;
        fs::write(stamp, hash)?;
        Ok(())
    }

    /// Hash of the paths and contents of all inputs.
    fn hash(&self) -> Result<String> {
        let mut files = Vec::new();
        for input in &self.inputs {
            list(input, &mut files)?;
        }
        files.sort();
        let mut hasher = blake3::Hasher::new();
        for file in files {
            let contents =
                fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
            hasher.update(file.to_string_lossy().as_bytes());
            hasher.update(blake3::hash(&contents).as_bytes());
        }
        Ok(hasher.finalize().to_hex().to_string())
    }
}

/// Runs `work` and prints its duration.
pub(crate) fn timed<T>(name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    let start = Instant::now();
    let result = work()?;
    println!("{name}: {:.1} s", start.elapsed().as_secs_f32());
    Ok(result)
}

fn list(path: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    if !path.is_dir() {
        files.push(path.into());
        return Ok(());
    }
    if path.file_name().is_some_and(|name| GENERATED.iter().any(|folder| name == *folder)) {
        return Ok(());
    }
    for entry in fs::read_dir(path).with_context(|| format!("cannot list {}", path.display()))? {
        list(&entry?.path(), files)?;
    }
    Ok(())
}
