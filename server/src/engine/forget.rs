//! Forgetting what jobs made.

use super::{Engine, LOCK};
use crate::problem::Problem;
use crate::store::{RecordKind, StoreError};
use serde_json::Value;
use std::fs::File;
use std::path::Path;
use std::time::Duration;

/// Ending of a dataset's folder while it is removed.
const GONE: &str = "gone";

/// A process that was told to end is looked for so often, and so long after each other.
const MOST_LOOKS: usize = 20;
const LOOK: Duration = Duration::from_millis(100);

impl Engine {
    /// Refuses to forget what a job that has not ended works on.
    pub(crate) async fn not_in_use(&self, id: &str) -> Result<(), Problem> {
        match self.store.user_of(id).await? {
            Some(job) => Err(Problem::in_use(id, &job)),
            None => Ok(()),
        }
    }

    /// Forgets a dataset, with its files.
    pub(crate) async fn forget_dataset(&self, record: &Value) -> Result<(), StoreError> {
        let text = |name: &str| record[name].as_str().unwrap_or_default();
        let folder = self.dataset_folder(text("hash"));
        let gone = folder.with_extension(GONE);
        unless_missing(tokio::fs::remove_dir_all(&gone).await)?;
        // At once, so that another job may make the same again; and first, so that whatever comes between leaves nothing
        // on the disk that no record names.
        unless_missing(tokio::fs::rename(&folder, &gone).await)?;
        self.store.forget(RecordKind::Dataset, text("id")).await?;
        Ok(unless_missing(tokio::fs::remove_dir_all(&gone).await)?)
    }

    /// Removes the folder of a job that has ended, once its process has let go of it.
    pub(crate) async fn remove_folder(&self, id: &str) {
        let folder = self.folder(id);
        let is_held = || File::open(folder.join(LOCK)).is_ok_and(|file| file.try_lock().is_err());
        for _ in 0..MOST_LOOKS {
            if !is_held() {
                break;
            }
            tokio::time::sleep(LOOK).await;
        }
        if let Err(error) = tokio::fs::remove_dir_all(&folder).await
            && error.kind() != std::io::ErrorKind::NotFound
        {
            tracing::warn!(job = id, %error, "its folder is left");
        }
    }

    /// Removes what a server that was killed left of what it was forgetting or keeping: folders of jobs that are no more,
    /// and files of meshes that came to be none.
    pub(super) async fn tidy_up(&self) -> Result<(), StoreError> {
        let mut entries = tokio::fs::read_dir(self.work_folder()).await?;
        while let Some(entry) = entries.next_entry().await? {
            let id = entry.file_name().to_string_lossy().into_owned();
            if self.store.job(&id).await?.is_none() {
                self.remove_folder(&id).await;
            }
        }
        for id in self.store.meshes_without_record().await? {
            self.store.forget_files(&id, None).await?;
        }
        Ok(())
    }

    /// Forgets a model of a job, with those of its files that no other model has.
    pub(crate) async fn forget_model(&self, record: &Value) -> Result<(), StoreError> {
        let text = |name: &str| record[name].as_str().unwrap_or_default();
        self.store.forget(RecordKind::Model, text("id")).await?;
        let folder = record["step"].as_u64().map_or(String::new(), |step| format!("step-{step}/"));
        let files = record["files"].as_object().into_iter().flatten();
        let names: Vec<String> = files.clone().map(|(name, _)| format!("{folder}{name}")).collect();
        self.store.forget_files(text("job"), Some(&names)).await?;
        // The job may have been forgotten before, and its list of files with it.
        let hashes = files.filter_map(|(_, file)| file["blake3"].as_str().map(str::to_owned));
        self.store.forget_unnamed(hashes.collect()).await
    }
}

/// What is not there need not be moved or removed.
fn unless_missing(done: std::io::Result<()>) -> std::io::Result<()> {
    match done {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

/// Removes what was being removed when the server before ended.
pub(super) fn sweep(datasets: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(datasets).into_iter().flatten() {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == GONE) {
            std::fs::remove_dir_all(path)?;
        }
    }
    Ok(())
}
