//! Repository rules as tests; this package links nothing of the project.

#![allow(clippy::unwrap_used, reason = "test helpers fail by panicking")]
#![cfg(test)]

mod browser_code;
mod dependencies;
mod documents;
mod notice;
mod prose;
mod systemd_unit;

use std::path::{Path, PathBuf};

/// Root folder of the repository.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Files with the given extension in a folder, recursively.
pub(crate) fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = folder.read_dir().unwrap_or_else(|e| panic!("{folder:?}: {e}"));
    let of_entry = |path: PathBuf| match path.is_dir() {
        true => files(&path, extension),
        false if path.extension().is_some_and(|found| found == extension) => vec![path],
        false => Vec::new(),
    };
    entries.flat_map(|entry| of_entry(entry.unwrap().path())).collect()
}
