//! Datasets in the data folder: added by jobs and by imports.

use super::JobScheduler;
use crate::store::{RecordKind, StoreError};
use chrono::Utc;
use dataset_manifest::{Manifest, SUMMARY_FILE};
use serde_json::{Value, json};
use std::io;
use std::path::Path;

impl JobScheduler {
    /// Moves a complete dataset with this hash from `from` to the folder of datasets and adds its record. Both
    /// steps can be repeated after a crash. Returns the id. `job`: the job that generated it.
    pub(crate) async fn add_dataset(
        &self,
        from: &Path,
        hash: &str,
        job: Option<&str>,
    ) -> Result<String, StoreError> {
        let folder = self.dataset_dir(hash);
        tokio::fs::create_dir_all(folder.parent().unwrap_or(&folder)).await?;
        // Another job may generate the same dataset at the same time.
        let moved = from.exists() && tokio::fs::rename(from, &folder).await.is_ok();
        let manifest = Manifest::read(&folder).map_err(io::Error::other)?;
        if !moved && from.exists() {
            tokio::fs::remove_dir_all(from).await?;
        }
        let summary: Value =
            serde_json::from_slice(&tokio::fs::read(folder.join(SUMMARY_FILE)).await?)?;
        let id = format!("ds_{}", hash.get(..16).unwrap_or(hash));
        let record = json!({
            "id": id, "object": "dataset", "hash": hash, "bytes": manifest.total_bytes(),
            "job": job, "created_at": Utc::now(), "config": manifest.provenance.config,
            "summary": summary,
        });
        self.store.add_record(RecordKind::Dataset, &id, &record).await?;
        Ok(id)
    }
}
