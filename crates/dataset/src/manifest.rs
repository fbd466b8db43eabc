//! The files of a dataset folder: writing its manifest, and verifying them.

use crate::lerobot::CARD_FILE;
use anyhow::{Context, Result, bail, ensure};
use dataset_manifest::{CONFIG_FILE, FileEntry, MANIFEST_FILE, Manifest, Provenance, SUMMARY_FILE};
use files::atomic_file;
use progress::Progress;
use std::ffi::OsStr;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Builds the manifest of a folder: hashes every file.
pub fn build(dir: &Path, provenance: Provenance) -> Result<Manifest> {
    let mut files = Vec::new();
    for path in list_files(dir)?.into_iter().filter(|path| is_hashed(path)) {
        files.push(hash_file(dir, &path)?);
    }
    let manifest = Manifest {
        generator: format!("ngf-grasp {}", env!("CARGO_PKG_VERSION")),
        provenance,
        files,
        hash: String::new(),
    };
    Ok(Manifest { hash: hash(&manifest)?, ..manifest })
}

/// BLAKE3 of a manifest without its hash, hex.
fn hash(manifest: &Manifest) -> Result<String> {
    let unhashed = Manifest { hash: String::new(), ..manifest.clone() };
    Ok(blake3::hash(&serde_json::to_vec(&unhashed)?).to_hex().to_string())
}

/// Writes a manifest to its dataset.
pub fn write(manifest: &Manifest, dir: &Path) -> Result<()> {
    atomic_file::write(&dir.join(MANIFEST_FILE), &serde_json::to_vec_pretty(manifest)?)
}

/// Hashes every file again and checks that no file is missing, changed or foreign.
pub fn verify_files(manifest: &Manifest, dir: &Path, progress: &dyn Progress) -> Result<()> {
    for (i, wanted) in manifest.files.iter().enumerate() {
        progress.update("check hashes", i, manifest.files.len());
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
    let known = |path: &Path| manifest.files.iter().any(|file| Path::new(&file.path) == path);
    for path in list_files(dir)?.into_iter().filter(|path| is_hashed(path)) {
        ensure!(known(&path), "{} does not belong to the dataset", path.display());
    }
    let hash = hash(manifest)?;
    ensure!(
        hash == manifest.hash,
        "{MANIFEST_FILE} has changed: it has hash {hash} instead of {}",
        manifest.hash
    );
    Ok(())
}

/// Names that a dataset folder may contain.
const KNOWN_ENTRIES: [&str; 13] = [
    CARD_FILE,
    CONFIG_FILE,
    MANIFEST_FILE,
    "log.jsonl",
    SUMMARY_FILE,
    "report.html",
    "attempts.parquet",
    "poses.parquet",
    "grasps",
    "ratings",
    "clouds",
    "data",
    "meta",
];

/// Folder of the shards, deleted after assembly.
pub const SHARDS_DIR: &str = "shards";

/// Rejects a folder with files that do not belong to a dataset.
pub fn reject_foreign_files(dir: &Path) -> Result<()> {
    let unreadable = || format!("cannot read {}", dir.display());
    for entry in std::fs::read_dir(dir).with_context(unreadable)? {
        let entry = entry.with_context(unreadable)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_known = KNOWN_ENTRIES.contains(&name.as_str())
            || name == SHARDS_DIR
            || is_system_entry(&entry.file_name());
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
pub fn delete_partial_files(dir: &Path) -> Result<()> {
    for path in list_files(dir)?.into_iter().map(|path| dir.join(path)) {
        if atomic_file::is_partial(&path) {
            std::fs::remove_file(&path)
                .with_context(|| format!("cannot delete {}", path.display()))?;
        }
    }
    Ok(())
}

/// Names of files and folders that file managers, git and the client of the Hugging Face Hub write.
const SYSTEM_ENTRIES: [&str; 9] = [
    "Thumbs.db",
    "desktop.ini",
    ".DS_Store",
    ".directory",
    "__MACOSX",
    ".git",
    ".gitattributes",
    ".gitignore",
    ".cache",
];

/// Whether a program wrote the file or folder without the user's request. macOS adds `._` and the name of a file
/// on foreign file systems.
fn is_system_entry(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    SYSTEM_ENTRIES.contains(&name.as_ref()) || name.starts_with("._")
}

/// Manifest, log, report, shards, partial and system files are not part of the dataset and are not hashed.
fn is_hashed(path: &Path) -> bool {
    let is_metadata =
        [MANIFEST_FILE, "log.jsonl", "report.html"].iter().any(|name| path == Path::new(name));
    !is_metadata
        && !path.starts_with(SHARDS_DIR)
        && !atomic_file::is_partial(path)
        && !path.iter().any(is_system_entry)
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
    use configs::DatasetConfig;
    use progress::NoProgress;
    use std::collections::BTreeMap;

    fn folder() -> (tempfile::TempDir, Manifest) {
        let folder = tempfile::tempdir().unwrap();
        atomic_file::write(&folder.path().join("meta/info.json"), b"{}").unwrap();
        atomic_file::write(&folder.path().join("log.jsonl"), b"one\n").unwrap();
        let config = DatasetConfig::preset("smoke", 0).unwrap();
        let (scene, objects) = (String::new(), BTreeMap::new());
        let manifest = build(folder.path(), Provenance { config, scene, objects }).unwrap();
        write(&manifest, folder.path()).unwrap();
        (folder, manifest)
    }

    #[test]
    fn verify_names_file_when_changed_missing_or_foreign() {
        let (folder, manifest) = folder();
        let dir = folder.path();
        let verify =
            || verify_files(&manifest, dir, &NoProgress).map_err(|error| error.to_string());
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
    fn files_of_file_managers_and_the_hub_are_ignored() {
        let (folder, manifest) = folder();
        let dir = folder.path();
        std::fs::create_dir_all(dir.join(".cache/huggingface")).unwrap();
        for name in [
            ".DS_Store",
            "meta/.DS_Store",
            "meta/._info.json",
            "Thumbs.db",
            "desktop.ini",
            ".gitattributes",
            ".cache/huggingface/info.json.metadata",
        ] {
            std::fs::write(dir.join(name), b"icons").unwrap();
        }
        verify_files(&manifest, dir, &NoProgress).unwrap();
        reject_foreign_files(dir).unwrap();
        assert_eq!(build(dir, manifest.provenance.clone()).unwrap(), manifest);
        std::fs::write(dir.join("meta/.hidden"), b"").unwrap();
        assert!(verify_files(&manifest, dir, &NoProgress).is_err());
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
