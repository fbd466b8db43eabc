//! Inputs of jobs: existence of datasets, models and meshes, and their paths for the worker.

use super::JobScheduler;
use crate::jobs::{Inputs, Params};
use crate::model::JOB_MODEL_PREFIX;
use crate::problem::Problem;
use crate::store::{RecordKind, StoreError};
use policy::model::WEIGHTS_FILE;
use std::io;
use std::path::{Path, PathBuf};

impl JobScheduler {
    /// Input ids of a job with these parameters; fails if an input does not exist.
    pub(crate) async fn resolve_inputs(&self, params: &Params) -> Result<Inputs, Problem> {
        let inputs = params.inputs();
        if let Some(id) = &inputs.mesh_id {
            let Some(record) = self.store.record(RecordKind::Mesh, id).await? else {
                return Err(Problem::input_not_found("mesh_id", id));
            };
            if record["size_required"] == true && !params.has_mesh_size() {
                return Err(Problem::mesh_size_required(id));
            }
        }
        if let Some(id) = &inputs.dataset_id
            && self.store.record(RecordKind::Dataset, id).await?.is_none()
        {
            return Err(Problem::input_not_found("dataset_id", id));
        }
        for (param, id) in [("encoder_id", &inputs.encoder_id), ("model_id", &inputs.model_id)] {
            if let Some(id) = id
                && !self.has_model(id).await?
            {
                return Err(Problem::input_not_found(param, id));
            }
        }
        if let Some(id) = &inputs.model_id
            && let Some(record) = self.store.record(RecordKind::Model, id).await?
            && record["kind"] == "encoder"
        {
            return Err(Problem::not_a_policy(id));
        }
        Ok(inputs)
    }

    /// Whether a built-in or trained model with this id exists.
    pub(crate) async fn has_model(&self, id: &str) -> Result<bool, StoreError> {
        if crate::model::is_valid_id(id) && self.models_dir().join(id).join(WEIGHTS_FILE).is_file()
        {
            return Ok(true);
        }
        Ok(self.store.record(RecordKind::Model, id).await?.is_some())
    }

    /// Folder with the files of a model: its own folder if built in, otherwise copies in the job folder.
    pub(super) async fn model_dir(&self, id: &str, folder: &Path) -> Result<PathBuf, StoreError> {
        if !id.starts_with(JOB_MODEL_PREFIX) {
            return Ok(self.models_dir().join(id));
        }
        let record = self.store.record(RecordKind::Model, id).await?;
        let deleted = || io::Error::other(format!("the model {id} was deleted"));
        let record = record.ok_or_else(deleted)?;
        let copies = folder.join("in").join(id);
        for (name, file) in record["files"].as_object().into_iter().flatten() {
            let hash = file["blake3"].as_str().unwrap_or_default();
            if !copies.join(name).exists() {
                self.store.copy_to(hash, &copies.join(name)).await?;
            }
        }
        Ok(copies)
    }

    /// Copy of a mesh in the job folder; the file name becomes the object name.
    pub(super) async fn mesh_file(&self, id: &str, folder: &Path) -> Result<PathBuf, StoreError> {
        let path = folder.join("in").join(format!("{id}.mesh"));
        if !path.exists() {
            let record = self.store.record(RecordKind::Mesh, id).await?;
            let deleted = || io::Error::other(format!("the mesh {id} was deleted"));
            let record = record.ok_or_else(deleted)?;
            self.store.copy_to(record["hash"].as_str().unwrap_or_default(), &path).await?;
        }
        Ok(path)
    }

    /// Folder of the dataset with this id.
    pub(super) async fn dataset_dir_by_id(&self, id: &str) -> Result<PathBuf, StoreError> {
        let record = self.store.record(RecordKind::Dataset, id).await?;
        let deleted = || io::Error::other(format!("the dataset {id} was deleted"));
        let record = record.ok_or_else(deleted)?;
        Ok(self.dataset_dir(record["hash"].as_str().unwrap_or_default()))
    }
}
