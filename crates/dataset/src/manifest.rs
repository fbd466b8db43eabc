//! The manifest: every file with its hash, what made it, and one hash that names the whole.

use crate::config::DatasetConfig;
use crate::folder::Inputs;
use crate::generate::Objects;
use crate::store;
use anyhow::{Context, Result, bail, ensure};
use std::fs::File;
use std::path::{Path, PathBuf};

/// Name of the manifest; it is written last, so a folder that has it is complete.
pub(crate) const MANIFEST: &str = "manifest.json";

/// A file of a dataset.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FileEntry {
    /// Path in the dataset, with slashes.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// BLAKE3 of its bytes, hex.
    pub blake3: String,
}

/// What a dataset consists of and where it comes from.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Manifest {
    /// Program that made it.
    pub generator: String,
    /// What it was made of.
    #[serde(flatten)]
    pub inputs: Inputs,
    /// All files but the manifest, by path.
    pub files: Vec<FileEntry>,
    /// BLAKE3 over everything above, hex.
    pub hash: String,
}

impl Manifest {
    /// Takes stock of a folder.
    pub(crate) fn of(dir: &Path, config: &DatasetConfig, objects: &Objects) -> Result<Self> {
        let mut files = Vec::new();
        for path in contents(dir)?.into_iter().filter(|path| is_hashed(path)) {
            files.push(entry(dir, &path)?);
        }
        let mut manifest = Self {
            generator: format!("ngf-grasp {}", env!("CARGO_PKG_VERSION")),
            inputs: Inputs::of(config, objects),
            files,
            hash: String::new(),
        };
        manifest.hash = blake3::hash(&serde_json::to_vec(&manifest)?).to_hex().to_string();
        Ok(manifest)
    }

    /// Reads the manifest of a complete dataset.
    pub fn read(dir: &Path) -> Result<Self> {
        let path = dir.join(MANIFEST);
        let bytes = std::fs::read(&path).with_context(|| {
            let cure = "complete it with --resume";
            format!(
                "{} is not there: {} is no complete dataset; {cure}",
                path.display(),
                dir.display()
            )
        })?;
        serde_json::from_slice(&bytes).with_context(|| format!("{} is damaged", path.display()))
    }

    pub(crate) fn write(&self, dir: &Path) -> Result<()> {
        store::write(&dir.join(MANIFEST), &serde_json::to_vec_pretty(self)?)
    }

    /// Size of all files.
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }

    /// Reads every file again: each must be there with its hash, and no other one.
    pub(crate) fn verify_files(&self, dir: &Path, progress: &dyn Fn(usize, usize)) -> Result<()> {
        for (i, wanted) in self.files.iter().enumerate() {
            progress(i, self.files.len());
            let path = PathBuf::from(&wanted.path);
            ensure!(dir.join(&path).exists(), "{} is missing", wanted.path);
            let found = entry(dir, &path)?;
            ensure!(
                found == *wanted,
                "{} has changed: it has hash {} instead of {}",
                wanted.path,
                found.blake3,
                wanted.blake3
            );
        }
        let known = |path: &Path| self.files.iter().any(|file| Path::new(&file.path) == path);
        for path in contents(dir)?.into_iter().filter(|path| is_hashed(path)) {
            ensure!(known(&path), "{} does not belong to the dataset", path.display());
        }
        let again = Self { hash: String::new(), ..self.clone() };
        let hash = blake3::hash(&serde_json::to_vec(&again)?).to_hex().to_string();
        ensure!(hash == self.hash, "{MANIFEST} has changed: its hash is {hash}, not {}", self.hash);
        Ok(())
    }
}

/// Names at the top of a dataset's folder.
const KNOWN: [&str; 11] = [
    "config.json",
    MANIFEST,
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

/// The folder of what is made before it is put together.
pub(crate) const PARTS: &str = "parts";

/// Refuses a folder in which something lies that is not a dataset's.
pub(crate) fn refuse_foreign(dir: &Path) -> Result<()> {
    let unreadable = || format!("cannot read {}", dir.display());
    for entry in std::fs::read_dir(dir).with_context(unreadable)? {
        let entry = entry.with_context(unreadable)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_known = KNOWN.contains(&name.as_str()) || name == PARTS;
        if !is_known && !store::is_half_written(&entry.path()) {
            bail!(
                "{} holds {name}, which is no part of a dataset; choose an empty folder",
                dir.display()
            );
        }
    }
    Ok(())
}

/// Removes what killed writers left half written.
pub(crate) fn remove_half_written(dir: &Path) -> Result<()> {
    for path in contents(dir)?.into_iter().map(|path| dir.join(path)) {
        if store::is_half_written(&path) {
            std::fs::remove_file(&path)
                .with_context(|| format!("cannot remove {}", path.display()))?;
        }
    }
    Ok(())
}

/// What is about the making, not of the dataset, has no hash.
fn is_hashed(path: &Path) -> bool {
    let about = [MANIFEST, "log.jsonl", "report.html"].iter().any(|name| path == Path::new(name));
    !about && !path.starts_with(PARTS) && !store::is_half_written(path)
}

/// Paths of all files in a folder, relative to it, sorted.
fn contents(dir: &Path) -> Result<Vec<PathBuf>> {
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

fn entry(dir: &Path, path: &Path) -> Result<FileEntry> {
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
        store::write(&folder.path().join("meta/info.json"), b"{}").unwrap();
        store::write(&folder.path().join("log.jsonl"), b"one\n").unwrap();
        let config = DatasetConfig::preset("smoke", 0).unwrap();
        let manifest = Manifest::of(folder.path(), &config, &Objects::new()).unwrap();
        manifest.write(folder.path()).unwrap();
        (folder, manifest)
    }

    #[test]
    fn a_changed_missing_or_foreign_file_is_named() {
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
    fn a_folder_with_other_things_is_refused_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("thesis.tex"), b"important").unwrap();
        let error = refuse_foreign(folder.path()).unwrap_err().to_string();
        assert!(error.contains("thesis.tex"), "{error}");
        assert!(refuse_foreign(&folder.path().join("nowhere")).is_err());
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
    }
}
