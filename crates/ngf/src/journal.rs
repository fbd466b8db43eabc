//! Results of a long run, kept one by one on disk: a killed run goes on where it was.

use anyhow::{Context, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// A file of lines `[key, value]`, after a first line that says whose results they are.
pub(crate) struct Journal {
    path: PathBuf,
    known: HashMap<String, Value>,
    file: Mutex<File>,
}

impl Journal {
    /// Opens it, or begins it anew if it is of another `owner`. A last line that was cut off is as if it were not there.
    pub(crate) fn open(path: PathBuf, owner: &str) -> Result<Self> {
        let text = std::fs::read(&path).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let first = serde_json::to_string(owner)? + "\n";
        let known: Option<HashMap<String, Value>> =
            whole.strip_prefix(&first).and_then(|lines| lines.lines().map(entry).collect());
        let kept = if known.is_some() { whole } else { &first };
        std::fs::write(&path, kept).with_context(|| cannot_write(&path))?;
        let file = OpenOptions::new().append(true).open(&path);
        let file = Mutex::new(file.with_context(|| cannot_write(&path))?);
        Ok(Self { path, known: known.unwrap_or_default(), file })
    }

    /// The result of this key, made by `make` if it is not known.
    pub(crate) fn result<T: Serialize + DeserializeOwned>(
        &self,
        key: &str,
        make: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        if let Some(value) = self.known.get(key) {
            return Ok(T::deserialize(value)?);
        }
        let made = make()?;
        let line = serde_json::to_string(&(key, &made))? + "\n";
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        file.write_all(line.as_bytes()).with_context(|| cannot_write(&self.path))?;
        Ok(made)
    }

    /// The run is over.
    pub(crate) fn remove(self) -> Result<()> {
        std::fs::remove_file(&self.path)
            .with_context(|| format!("cannot remove {}", self.path.display()))
    }
}

fn entry(line: &str) -> Option<(String, Value)> {
    serde_json::from_str(line).ok()
}

fn cannot_write(path: &Path) -> String {
    format!("cannot write {}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_not_made_again_unless_it_is_of_another_run() {
        let path = std::env::temp_dir().join(format!("ngf-journal-{}", std::process::id()));
        let numbers = |owner: &str, wanted: &[u32]| -> Vec<bool> {
            let journal = Journal::open(path.clone(), owner).unwrap();
            let is_made = |n: &u32| {
                let mut made = false;
                let square = journal.result(&n.to_string(), || {
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
        // Killed while it wrote.
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 2]).unwrap();
        assert_eq!(numbers("a", &[1, 2, 3]), [false, false, true]);
        assert_eq!(numbers("b", &[1]), [true]);
        Journal::open(path.clone(), "b").unwrap().remove().unwrap();
        assert!(!path.exists());
    }
}
