//! Provenance of a dataset: the inputs that determine its bytes.

use anyhow::{Context, Result, bail};
use configs::dataset::{DatasetConfig, VERSION};
use std::collections::BTreeMap;
use std::path::Path;

/// File with the [`Provenance`], written before the data.
pub const CONFIG_FILE: &str = "config.json";

/// Inputs that determine the bytes of a dataset, except for the program version.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Provenance {
    /// Requested contents.
    pub config: DatasetConfig,
    /// BLAKE3 of scene file and robot description, hex.
    pub scene: String,
    /// BLAKE3 of each object's shape, mass and friction, hex.
    pub objects: BTreeMap<String, String>,
}

impl Provenance {
    /// Reads the provenance of a dataset; fails if the dataset has another format version.
    pub fn read(dir: &Path) -> Result<Self> {
        let path = dir.join(CONFIG_FILE);
        let text = std::fs::read_to_string(&path).with_context(|| {
            format!("{} is not a dataset: it has no {CONFIG_FILE}", dir.display())
        })?;
        let provenance: Self = serde_json::from_str(&text).with_context(|| {
            format!(
                "{} does not have format version {VERSION}; generate the dataset again",
                path.display()
            )
        })?;
        let version = provenance.config.version;
        if version != VERSION {
            bail!(
                "{} has format version {version}, not {VERSION}; generate it again",
                path.display()
            );
        }
        Ok(provenance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dataset_of_another_version_is_rejected() {
        let folder = tempfile::tempdir().unwrap();
        let read = || Provenance::read(folder.path()).map_err(|error| error.to_string());
        assert!(read().unwrap_err().ends_with("is not a dataset: it has no config.json"));
        let config = DatasetConfig::preset("smoke", 0).unwrap();
        let objects = BTreeMap::from([("sugar_box".to_owned(), "ab".to_owned())]);
        let mut provenance = Provenance { config, scene: "cd".into(), objects };
        let write = |provenance: &Provenance| {
            let text = serde_json::to_string_pretty(provenance).unwrap();
            std::fs::write(folder.path().join(CONFIG_FILE), text).unwrap();
        };
        write(&provenance);
        assert_eq!(read().as_ref(), Ok(&provenance));
        provenance.config.version = 0;
        write(&provenance);
        let wanted = format!("has format version 0, not {VERSION}; generate it again");
        assert!(read().unwrap_err().ends_with(&wanted));
        std::fs::write(folder.path().join(CONFIG_FILE), "{}").unwrap();
        assert!(read().unwrap_err().contains("does not have format version"));
    }
}
