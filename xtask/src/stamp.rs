//! Steps that are skipped while their inputs stay as they were.

use crate::place::Place;
use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A step, what it reads and what it makes.
pub(crate) struct Step<'a> {
    /// Said when it runs, as in "page: 2.1 s".
    pub(crate) name: &'a str,
    /// Files, and folders with everything in them.
    pub(crate) inputs: Vec<PathBuf>,
    /// Must exist for the step to be skipped.
    pub(crate) output: PathBuf,
}

/// Folders that are made, not written.
const MADE: [&str; 2] = ["node_modules", "dist"];

impl Step<'_> {
    /// Does the work, unless it was done with the same inputs before.
    pub(crate) fn run(&self, place: &Place, work: impl FnOnce() -> Result<()>) -> Result<()> {
        let stamp = place.target.join("xtask").join(format!("{}.stamp", self.name));
        let wanted = self.hash()?;
        if self.output.exists() && fs::read_to_string(&stamp).is_ok_and(|known| known == wanted) {
            return Ok(());
        }
        // Without a stamp until it is done: a step that was interrupted runs again.
        fs::remove_file(&stamp).ok();
        timed(self.name, work)?;
        fs::create_dir_all(stamp.parent().context("a stamp has a folder")?)?;
        fs::write(stamp, wanted)?;
        Ok(())
    }

    /// The hash of names and contents of all inputs.
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

/// Does the work and says how long it took.
pub(crate) fn timed<T>(name: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    let begin = Instant::now();
    let result = work()?;
    println!("{name}: {:.1} s", begin.elapsed().as_secs_f32());
    Ok(result)
}

fn list(path: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    if !path.is_dir() {
        files.push(path.into());
        return Ok(());
    }
    if path.file_name().is_some_and(|name| MADE.iter().any(|made| name == *made)) {
        return Ok(());
    }
    for entry in fs::read_dir(path).with_context(|| format!("cannot list {}", path.display()))? {
        list(&entry?.path(), files)?;
    }
    Ok(())
}
