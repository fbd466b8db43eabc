//! Manifest of a dataset: all files with their hashes, provenance, and one hash of the whole.

use crate::Provenance;
use anyhow::{Context, Result, bail};
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

impl FileEntry {
    /// Whether the path stays in the folder of the dataset: relative, without `.` and `..`.
    fn is_inside(&self) -> bool {
        let is_name = |name: &str| !["", ".", ".."].contains(&name);
        self.path.split('/').all(is_name) && !self.path.contains(['\\', ':'])
    }
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
        let manifest: Self = serde_json::from_slice(&bytes)
            .with_context(|| format!("{} is damaged", path.display()))?;
        // An imported manifest is untrusted: readers join its paths with the folder.
        let leaves = |file: &&FileEntry| !file.is_inside();
        if let Some(file) = manifest.files.iter().find(leaves) {
            bail!("{}: the path {:?} leaves the dataset", path.display(), file.path);
        }
        Ok(manifest)
    }

    /// Total size of all files in bytes.
    pub fn total_bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use configs::DatasetConfig;
    use std::collections::BTreeMap;

    #[test]
    fn manifest_with_paths_outside_the_dataset_is_rejected() {
        let folder = tempfile::tempdir().unwrap();
        let config = DatasetConfig::preset("smoke", 0).unwrap();
        let read = |path: &str| {
            let provenance = Provenance {
                config: config.clone(),
                scene: String::new(),
                objects: BTreeMap::new(),
            };
            let file = FileEntry { path: path.into(), bytes: 1, blake3: "ab".into() };
            let manifest = Manifest {
                generator: String::new(),
                provenance,
                files: vec![file],
                hash: String::new(),
            };
            let text = serde_json::to_string(&manifest).unwrap();
            std::fs::write(folder.path().join(MANIFEST_FILE), text).unwrap();
            Manifest::read(folder.path())
        };
        assert_eq!(read("meta/info.json").unwrap().total_bytes(), 1);
        for path in ["../x", "/etc/passwd", "a/../../x", "a//b", "./a", "", "c:\\x"] {
            let error = read(path).unwrap_err().to_string();
            assert!(error.contains("leaves the dataset"), "{path}: {error}");
        }
    }
}
