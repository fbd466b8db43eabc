//! Atomic file writes: a killed process leaves either the old file or the new file.

use anyhow::{Context, Result};
use std::path::Path;

/// Writes a temporary file in the same folder and renames it, so that a killed process leaves either the old
/// file or the new file.
///
/// ```rust
/// let folder = tempfile::tempdir()?;
/// // Missing folders are created.
/// let path = folder.path().join("evaluation/report.json");
/// files::atomic_file::write(&path, b"{}")?;
/// assert_eq!(files::atomic_file::read(&path)?, b"{}");
/// # Ok::<(), anyhow::Error>(())
/// ```
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    write_with(path, |file| Ok(std::fs::write(file, bytes)?))
}

/// Atomic write of a file whose contents `make` produces. `make` receives the temporary path.
pub fn write_with<T>(path: &Path, make: impl FnOnce(&Path) -> Result<T>) -> Result<T> {
    let folder = path.parent().context("the path has no parent folder")?;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot create {}", folder.display()))?;
    let temporary = path.with_extension(format!("{PARTIAL_PREFIX}{}", std::process::id()));
    let written = make(&temporary).and_then(|made| {
        // Without this, a power failure could leave an empty file under the final name.
        std::fs::File::open(&temporary)?.sync_all()?;
        std::fs::rename(&temporary, path)?;
        Ok(made)
    });
    written.map_err(|error| {
        // A partial file is useless and occupies space, and the disk may be full.
        std::fs::remove_file(&temporary).ok();
        error.context(format!("cannot write {}", path.display()))
    })
}

/// Prefix of the extension of partially written files.
const PARTIAL_PREFIX: &str = "part-";

/// Whether a file is partial because its writer was killed.
pub fn is_partial(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().into_owned());
    ending.is_some_and(|ending| ending.starts_with(PARTIAL_PREFIX))
}

/// Reads a file; the error names its path.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failed_write_keeps_old_file_and_removes_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b.json");
        write(&path, b"old").unwrap();
        let failed = write_with(&path, |file| {
            std::fs::write(file, b"half")?;
            anyhow::bail!("the disk is full")
        });
        let failed: Result<()> = failed;
        assert!(format!("{:#}", failed.unwrap_err()).contains("b.json: the disk is full"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(path.parent().unwrap().read_dir().unwrap().count(), 1);
    }
}
