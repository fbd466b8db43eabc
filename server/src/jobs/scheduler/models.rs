//! Import of models.

use super::JobScheduler;
use crate::model_manifest::ModelManifest;
use crate::store::{RecordKind, StoreError};
use chrono::Utc;
use serde_json::{Map, Value, json};
use std::path::Path;

impl JobScheduler {
    /// Stores the verified files of a model in a folder, and adds its record. The files belong to the model, not
    /// to a job.
    pub(crate) async fn import_model(
        &self,
        folder: &Path,
        manifest: &ModelManifest,
    ) -> Result<Value, StoreError> {
        let id = manifest.model_id();
        let mut files = Map::new();
        for name in manifest.files.keys() {
            let artifact = self.store.put_file(&id, name, &folder.join(name)).await?;
            let entry = json!({ "blake3": artifact.hash, "bytes": artifact.bytes });
            files.insert(name.clone(), entry);
        }
        let record = json!({
            "id": id, "object": "model", "kind": manifest.kind, "job": null, "step": manifest.step,
            "created_at": Utc::now(), "params": manifest.params, "files": files,
        });
        self.store.add_record(RecordKind::Model, &id, &record).await?;
        Ok(record)
    }
}
