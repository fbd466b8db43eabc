//! Descriptions of a dataset that readers need before its data: provenance, manifest and summary.
//!
//! In: the JSON files of a dataset folder. Does not read demonstrations or clouds, so it does not depend on
//! Parquet.

mod manifest;
mod provenance;
mod summary;

pub use manifest::{FileEntry, MANIFEST_FILE, Manifest};
pub use provenance::{CONFIG_FILE, Provenance};
pub use summary::{KEPT, SUMMARY_FILE, Summary};

use std::path::Path;

/// Checks that a folder contains a complete dataset of the current format version, and returns its
/// provenance.
///
/// ```rust
/// let folder = tempfile::tempdir()?;
/// let error = dataset_manifest::open(folder.path()).unwrap_err();
/// assert!(error.to_string().ends_with("is not a dataset: it has no config.json"));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn open(dir: &Path) -> anyhow::Result<Provenance> {
    let provenance = Provenance::read(dir)?;
    Manifest::read(dir)?;
    Ok(provenance)
}
