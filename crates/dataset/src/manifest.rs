//! Manifest of a dataset: all files with their hashes, provenance, and one hash of the whole.

use crate::config::DatasetConfig;
use crate::dataset::Provenance;
use crate::generate::Objects;
use anyhow::{Context, Result, bail, ensure};
use files::atomic_file;
use std::fs::File;
use std::path::{Path, PathBuf};

/// File name of the manifest. It is written last, so its presence marks a complete dataset.
pub(crate) const MANIFEST_FILE: &str = "manifest.json";

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
    /// Builds the manifest of a folder.
    pub(crate) fn build(dir: &Path, config: &DatasetConfig, objects: &Objects) -> Result<Self> {
        let mut files = Vec::new();
        for path in list_files(dir)?.into_iter().filter(|path| is_hashed(path)) {
            files.push(hash_file(dir, &path)?);
        }
        let mut manifest = Self {
            generator: format!("ngf-grasp {}", env!("CARGO_PKG_VERSION")),
            provenance: Provenance::of(config, objects),
            files,
            hash: String::new(),
        };
        manifest.hash = blake3::hash(&serde_json::to_vec(&manifest)?).to_hex().to_string();
        Ok(manifest)
    }

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

    pub(crate) fn write(&self, dir: &Path) -> Result<()> {
        atomic_file::write(&dir.join(MANIFEST_FILE), &serde_json::to_vec_pretty(self)?)
    }

    /// Total size of all files in bytes.
    pub fn total_bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }

    /// Hashes every file again and checks that no file is missing, changed or foreign.
    pub(crate) fn verify_files(&self, dir: &Path, progress: &dyn Fn(usize, usize)) -> Result<()> {
        for (i, wanted) in self.files.iter().enumerate() {
            progress(i, self.files.len());
            let path = PathBuf::from(&wanted.path);
            ensure!(dir.join(&path).exists(), "{} is missing", wanted.path);
            let found = hash_file(dir, &path)?;
            ensure!(
                found == *wanted,
                "{} has changed: it has hash {} instead of {}",
                wanted.path,
                found.blake3,
                wanted.blake3
            );
        }
        let known = |path: &Path| self.files.iter().any(|file| Path::new(&file.path) == path);
        for path in list_files(dir)?.into_iter().filter(|path| is_hashed(path)) {
            ensure!(known(&path), "{} does not belong to the dataset", path.display());
        }
        let again = Self { hash: String::new(), ..self.clone() };
        let hash = blake3::hash(&serde_json::to_vec(&again)?).to_hex().to_string();
        ensure!(
            hash == self.hash,
            "{MANIFEST_FILE} has changed: it has hash {hash} instead of {}",
            self.hash
        );
        Ok(())
    }
}

/// Names that a dataset folder may contain.
const KNOWN_ENTRIES: [&str; 11] = [
    "config.json",
    MANIFEST_FILE,
    "log.jsonl",
    "summary.json",
    "report.html",
    "attempts.parquet",
    "poses.parquet",
    "grasps",
    "clouds",
    "data",
    "meta",
];

/// Folder of the shards, deleted after assembly.
pub(crate) const SHARDS_DIR: &str = "shards";

/// Rejects a folder with files that do not belong to a dataset.
pub(crate) fn reject_foreign_files(dir: &Path) -> Result<()> {
    let unreadable = || format!("cannot read {}", dir.display());
    for entry in std::fs::read_dir(dir).with_context(unreadable)? {
        let entry = entry.with_context(unreadable)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_known = KNOWN_ENTRIES.contains(&name.as_str()) || name == SHARDS_DIR;
        if !is_known && !atomic_file::is_partial(&entry.path()) {
            bail!(
                "{} contains {name}, which does not belong to a dataset; choose an empty folder",
                dir.display()
            );
        }
    }
    Ok(())
}

/// Deletes partial files of killed writers.
pub(crate) fn delete_partial_files(dir: &Path) -> Result<()> {
    for path in list_files(dir)?.into_iter().map(|path| dir.join(path)) {
        if atomic_file::is_partial(&path) {
            std::fs::remove_file(&path)
                .with_context(|| format!("cannot delete {}", path.display()))?;
        }
    }
    Ok(())
}

/// Manifest, log, report, shards and partial files are not part of the dataset and are not hashed.
fn is_hashed(path: &Path) -> bool {
    let is_metadata =
        [MANIFEST_FILE, "log.jsonl", "report.html"].iter().any(|name| path == Path::new(name));
    !is_metadata && !path.starts_with(SHARDS_DIR) && !atomic_file::is_partial(path)
}

/// Paths of all files below a folder, relative to it, sorted.
fn list_files(dir: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        let at = dir.join(&folder);
        let unreadable = || format!("cannot read {}", at.display());
        for entry in std::fs::read_dir(&at).with_context(unreadable)? {
            let entry = entry.with_context(unreadable)?;
            let path = folder.join(entry.file_name());
            let is_folder = entry.file_type().with_context(unreadable)?.is_dir();
            if is_folder { folders.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    Ok(files)
}

fn hash_file(dir: &Path, path: &Path) -> Result<FileEntry> {
    let full = dir.join(path);
    let unreadable = || format!("cannot read {}", full.display());
    let mut hasher = blake3::Hasher::new();
    let bytes = hasher.update_reader(File::open(&full).with_context(unreadable)?);
    bytes.with_context(unreadable)?;
    let words: Vec<_> = path.iter().map(|word| word.to_string_lossy()).collect();
    Ok(FileEntry {
        path: words.join("/"),
        bytes: hasher.count(),
        blake3: hasher.finalize().to_hex().to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> (tempfile::TempDir, Manifest) {
        let folder = tempfile::tempdir().unwrap();
        atomic_file::write(&folder.path().join("meta/info.json"), b"{}").unwrap();
        atomic_file::write(&folder.path().join("log.jsonl"), b"one\n").unwrap();
        let config = DatasetConfig::preset("smoke", 0).unwrap();
        let manifest = Manifest::build(folder.path(), &config, &Objects::new()).unwrap();
        manifest.write(folder.path()).unwrap();
        (folder, manifest)
    }

    #[test]
    fn verify_names_file_when_changed_missing_or_foreign() {
        let (folder, manifest) = folder();
        let dir = folder.path();
        let verify = || manifest.verify_files(dir, &|_, _| ()).map_err(|error| error.to_string());
        assert_eq!(Manifest::read(dir).unwrap(), manifest);
        verify().unwrap();
        std::fs::write(dir.join("log.jsonl"), b"two\n").unwrap();
        verify().unwrap();
        std::fs::write(dir.join("meta/info.json"), b"{ }").unwrap();
        assert!(verify().unwrap_err().contains("meta/info.json has changed"));
        std::fs::remove_file(dir.join("meta/info.json")).unwrap();
        assert!(verify().unwrap_err().contains("meta/info.json is missing"));
        std::fs::write(dir.join("meta/info.json"), b"{}").unwrap();
        std::fs::write(dir.join("meta/more.json"), b"{}").unwrap();
        assert!(verify().unwrap_err().contains("meta/more.json does not belong"));
    }

    #[test]
    fn folder_with_foreign_files_is_rejected_and_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("thesis.tex"), b"important").unwrap();
        let error = reject_foreign_files(folder.path()).unwrap_err().to_string();
        assert!(error.contains("thesis.tex"), "{error}");
        assert!(reject_foreign_files(&folder.path().join("nowhere")).is_err());
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    }
}
