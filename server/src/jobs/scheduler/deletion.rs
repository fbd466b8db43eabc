//! Deletion of datasets, models and job folders, and recovery after a crash.

use super::{JobScheduler, LOCK_FILE};
use crate::problem::Problem;
use crate::store::{RecordKind, StoreError};
use serde_json::Value;
use std::fs::File;
use std::path::Path;
use std::time::Duration;

/// Extension of a dataset folder during its deletion.
const TRASH_SUFFIX: &str = "trash";

/// Number of checks whether a worker has released the lock of its folder.
const MAX_LOCK_CHECKS: usize = 20;
/// Time between two of these checks.
const LOCK_CHECK_INTERVAL: Duration = Duration::from_millis(100);

impl JobScheduler {
    /// Rejects the deletion of an input of an unfinished job.
    pub(crate) async fn ensure_unused(&self, id: &str) -> Result<(), Problem> {
        match self.store.active_job_using(id).await? {
            Some(job) => Err(Problem::in_use(id, &job)),
            None => Ok(()),
        }
    }

    /// Deletes a dataset: record and files.
    pub(crate) async fn delete_dataset(&self, record: &Value) -> Result<(), StoreError> {
        let text = |name: &str| record[name].as_str().unwrap_or_default();
        let folder = self.dataset_dir(text("hash"));
        let trash = folder.with_extension(TRASH_SUFFIX);
        ignore_missing(tokio::fs::remove_dir_all(&trash).await)?;
        // The rename is atomic, so another job can generate the same dataset again. It precedes the deletion
        // of the record, so a crash leaves no files without a record.
        ignore_missing(tokio::fs::rename(&folder, &trash).await)?;
        let deleted = self.store.delete_record(RecordKind::Dataset, text("id")).await;
        ignore_missing(tokio::fs::remove_dir_all(&trash).await)?;
        match deleted {
            // The files have made space for the database.
            Err(error) if error.is_disk_full() => {
                self.store.delete_record(RecordKind::Dataset, text("id")).await
            }
            deleted => deleted,
        }
    }

    /// Deletes a finished or damaged job and its folder. On a full disk, the folder is deleted first, because the
    /// database needs its space.
    pub(crate) async fn delete_job(&self, id: &str, delete_files: bool) -> Result<(), StoreError> {
        match self.delete_job_records(id, delete_files).await {
            Err(error) if error.is_disk_full() => {
                self.remove_job_dir(id).await;
                self.delete_job_records(id, delete_files).await?;
            }
            deleted => deleted?,
        }
        self.remove_job_dir(id).await;
        Ok(())
    }

    /// Deletes the rows of a job, optionally with its stored files.
    async fn delete_job_records(&self, id: &str, delete_files: bool) -> Result<(), StoreError> {
        if delete_files {
            self.store.delete_files(id, None).await?;
        }
        self.store.delete_job(id).await
    }

    /// Deletes the folder of a finished job after its worker has released the lock, or after 2 s.
    pub(crate) async fn remove_job_dir(&self, id: &str) {
        let folder = self.job_dir(id);
        let is_locked =
            || File::open(folder.join(LOCK_FILE)).is_ok_and(|file| file.try_lock().is_err());
        for _ in 0..MAX_LOCK_CHECKS {
            if !is_locked() {
                break;
            }
            tokio::time::sleep(LOCK_CHECK_INTERVAL).await;
        }
        if let Err(error) = tokio::fs::remove_dir_all(&folder).await
            && error.kind() != std::io::ErrorKind::NotFound
        {
            tracing::warn!(job = id, %error, "cannot delete the job folder");
        }
    }

    /// Cleans up after a server crash: deletes job folders without a job, and files of meshes and imported models
    /// without a record.
    pub(super) async fn recover(&self) -> Result<(), StoreError> {
        let mut entries = tokio::fs::read_dir(self.work_dir()).await?;
        while let Some(entry) = entries.next_entry().await? {
            let id = entry.file_name().to_string_lossy().into_owned();
            if !self.store.has_job(&id).await? {
                self.remove_job_dir(&id).await;
            }
        }
        for id in self.store.orphan_uploads().await? {
            // A full disk does not prevent the start.
            if let Err(error) = self.store.delete_files(&id, None).await {
                tracing::warn!(upload = id, %error, "cannot delete the files of a deleted upload");
            }
        }
        Ok(())
    }

    /// Deletes a model that a job produced, and its files that no other record references.
    pub(crate) async fn delete_model(&self, record: &Value) -> Result<(), StoreError> {
        let text = |name: &str| record[name].as_str().unwrap_or_default();
        self.store.delete_record(RecordKind::Model, text("id")).await?;
        let step = record["step"].as_u64().filter(|_| !record["job"].is_null());
        let folder = step.map_or(String::new(), |step| format!("step-{step}/"));
        let files = record["files"].as_object().into_iter().flatten();
        let names: Vec<String> = files.clone().map(|(name, _)| format!("{folder}{name}")).collect();
        // The files of an imported model belong to the model itself.
        let owner = if record["job"].is_null() { text("id") } else { text("job") };
        self.store.delete_files(owner, Some(&names)).await?;
        // The job and its list of files may already be deleted.
        let hashes = files.filter_map(|(_, file)| file["blake3"].as_str().map(str::to_owned));
        self.store.collect_garbage(hashes.collect()).await
    }
}

/// Treats a missing file as success.
fn ignore_missing(result: std::io::Result<()>) -> std::io::Result<()> {
    match result {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

/// Deletes incomplete artifacts of a former server process that was killed: `HASH#NUMBER`.
pub(super) fn remove_incomplete(artifacts: &Path) -> std::io::Result<()> {
    for folder in std::fs::read_dir(artifacts).into_iter().flatten() {
        for file in std::fs::read_dir(folder?.path()).into_iter().flatten() {
            let path = file?.path();
            if path.file_name().is_some_and(|name| name.to_string_lossy().contains('#')) {
                ignore_missing(std::fs::remove_file(path))?;
            }
        }
    }
    Ok(())
}

/// Completes the dataset deletions that a former server process did not finish.
pub(super) fn remove_trash(datasets: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(datasets).into_iter().flatten() {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == TRASH_SUFFIX) {
            std::fs::remove_dir_all(path)?;
        }
    }
    Ok(())
}
