//! Disk cache of individual results, from which a killed run resumes.

use anyhow::{Context, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// A file with lines `[key, value]` after a first line with the fingerprint of the run.
pub(crate) struct ResultCache {
    path: PathBuf,
    cached: HashMap<String, Value>,
    file: Mutex<File>,
}

impl ResultCache {
    /// Opens the cache, or clears it if it has another fingerprint. An incomplete last line is ignored.
    pub(crate) fn open(path: PathBuf, fingerprint: &str) -> Result<Self> {
        let text = std::fs::read(&path).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let first = serde_json::to_string(fingerprint)? + "\n";
        let known: Option<HashMap<String, Value>> =
            whole.strip_prefix(&first).and_then(|lines| lines.lines().map(parse_line).collect());
        let kept = if known.is_some() { whole } else { &first };
        std::fs::write(&path, kept).with_context(|| cannot_write(&path))?;
        let file = OpenOptions::new().append(true).open(&path);
        let file = Mutex::new(file.with_context(|| cannot_write(&path))?);
        Ok(Self { path, cached: known.unwrap_or_default(), file })
    }

    /// Returns the cached result of `key`, or computes and stores it.
    pub(crate) fn get_or_compute<T: Serialize + DeserializeOwned>(
        &self,
        key: &str,
        make: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        if let Some(value) = self.cached.get(key) {
            return Ok(T::deserialize(value)?);
        }
        let made = make()?;
        let line = serde_json::to_string(&(key, &made))? + "\n";
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        file.write_all(line.as_bytes()).with_context(|| cannot_write(&self.path))?;
        Ok(made)
    }

    /// Deletes the cache after the run has finished.
    pub(crate) fn delete(self) -> Result<()> {
        std::fs::remove_file(&self.path)
            .with_context(|| format!("cannot delete {}", self.path.display()))
    }
}

fn parse_line(line: &str) -> Option<(String, Value)> {
    serde_json::from_str(line).ok()
}

fn cannot_write(path: &Path) -> String {
    format!("cannot write {}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cached_results_are_reused_only_within_same_run() {
        let path = std::env::temp_dir().join(format!("ngf-journal-{}", std::process::id()));
        let numbers = |fingerprint: &str, wanted: &[u32]| -> Vec<bool> {
            let journal = ResultCache::open(path.clone(), fingerprint).unwrap();
            let is_made = |n: &u32| {
                let mut made = false;
                let square = journal.get_or_compute(&n.to_string(), || {
                    made = true;
                    Ok(n * n)
                });
                assert_eq!(square.unwrap(), n * n);
                made
            };
            wanted.iter().map(is_made).collect()
        };
        std::fs::remove_file(&path).ok();
        assert_eq!(numbers("a", &[1, 2]), [true, true]);
        assert_eq!(numbers("a", &[2, 3]), [false, true]);
        // Simulates a process that was killed while writing.
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 2]).unwrap();
        assert_eq!(numbers("a", &[1, 2, 3]), [false, false, true]);
        assert_eq!(numbers("b", &[1]), [true]);
        ResultCache::open(path.clone(), "b").unwrap().delete().unwrap();
        assert!(!path.exists());
    }
}
