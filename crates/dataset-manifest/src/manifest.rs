//! Manifest of a dataset: all files with their hashes, provenance, and one hash of the whole.

use crate::Provenance;
use anyhow::{Context, Result};
use std::path::Path;

/// File name of the manifest. It is written last, so its presence marks a complete dataset.
pub const MANIFEST_FILE: &str = "manifest.json";

/// One file of a dataset.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FileEntry {
    /// Path relative to the dataset, separated by slashes.
    pub path: String,
    /// Size in bytes.
    pub bytes: u64,
    /// BLAKE3 hash of the contents, hex.
    pub blake3: String,
}

/// Files and provenance of a dataset.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Manifest {
    /// Name and version of the program that generated the dataset.
    pub generator: String,
    /// Configuration, scene and objects.
    #[serde(flatten)]
    pub provenance: Provenance,
    /// All files except the manifest, sorted by path.
    pub files: Vec<FileEntry>,
    /// BLAKE3 hash of the fields above, hex.
    pub hash: String,
}

impl Manifest {
    /// Reads the manifest of a complete dataset.
    pub fn read(dir: &Path) -> Result<Self> {
        let path = dir.join(MANIFEST_FILE);
        let bytes = std::fs::read(&path).with_context(|| {
            let hint = "complete it with --resume";
            format!(
                "{} does not exist, so {} is not a complete dataset; {hint}",
                path.display(),
                dir.display()
            )
        })?;
        serde_json::from_slice(&bytes).with_context(|| format!("{} is damaged", path.display()))
    }

    /// Total size of all files in bytes.
    pub fn total_bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }
}
