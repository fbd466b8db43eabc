//! Outputs of jobs: stores their files as artifacts and models.

use super::JobScheduler;
use crate::jobs::kinds::{OUT_DIR, ParamsView};
use crate::jobs::{Job, Outputs};
use crate::model_manifest::model_id;
use crate::store::{Artifact, EventType, NewEvent, RecordKind, StoreError};
use chrono::Utc;
use dataset_manifest::Manifest;
use policy::model::MODEL_FILES;
use serde_json::{Value, json};
use std::io;
use std::path::{Path, PathBuf};

/// Collects the outputs of a job whose worker succeeded.
#[derive(Debug)]
pub(crate) struct OutputCollector<'a> {
    pub(crate) scheduler: &'a JobScheduler,
    pub(crate) job: &'a Job,
    /// Folder with the files that the worker has written.
    pub(crate) folder: PathBuf,
    /// Ids of the stored outputs.
    pub(crate) outputs: Outputs,
    /// Events that announce the stored files.
    events: Vec<NewEvent>,
}

/// Outputs of a job, and the events that announce them.
#[derive(Debug, Default)]
pub(super) struct JobOutputs {
    pub(super) outputs: Outputs,
    pub(super) events: Vec<NewEvent>,
}

/// Whether a file is internal to the worker: a training checkpoint or an incomplete file.
fn is_internal(name: &str) -> bool {
    name.contains("checkpoint") || name.contains(".part-")
}

impl OutputCollector<'_> {
    fn add(&mut self, artifact: &Artifact) {
        self.outputs.artifact_ids.push(artifact.hash.clone());
        self.events.push(NewEvent::new(
            EventType::Artifact,
            artifact.name.clone(),
            json!(artifact),
        ));
    }

    /// Stores every file of the folder as an artifact, except internal ones.
    pub(crate) async fn store_files(&mut self) -> Result<Vec<Artifact>, StoreError> {
        let mut artifacts = Vec::new();
        for path in list_files(&self.folder)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if !is_internal(&name) {
                let artifact = self.scheduler.store.put_file(&self.job.id, &name, &path).await?;
                self.add(&artifact);
                artifacts.push(artifact);
            }
        }
        Ok(artifacts)
    }

    /// Moves the dataset in the folder to that of the datasets and adds its record.
    pub(crate) async fn store_dataset(&mut self) -> Result<(), StoreError> {
        // Idempotent: if the server is killed between two steps, the worker repeats its report.
        let hash_file = self.scheduler.job_dir(&self.job.id).join("dataset");
        let hash = match Manifest::read(&self.folder) {
            Ok(manifest) => {
                tokio::fs::write(&hash_file, &manifest.hash).await?;
                manifest.hash
            }
            Err(error) => {
                let hash = tokio::fs::read_to_string(&hash_file).await;
                hash.map_err(|_| io::Error::other(error))?
            }
        };
        let id = self.scheduler.add_dataset(&self.folder, &hash, Some(&self.job.id)).await?;
        self.outputs.dataset_id = Some(id);
        Ok(())
    }

    /// Stores a trained model with its checkpoints. `kind`: `encoder` or `policy`.
    pub(crate) async fn store_model(&mut self, kind: &str) -> Result<(), StoreError> {
        self.scheduler.store_checkpoints(self.job).await?;
        let files = self.store_files().await?;
        let id = self.scheduler.add_model(self.job, kind, &files, None).await?;
        self.outputs.model_id = Some(id);
        Ok(())
    }
}

impl JobScheduler {
    /// Stores all outputs of a job whose worker succeeded.
    pub(super) async fn collect_outputs(&self, job: &Job) -> Result<JobOutputs, StoreError> {
        let mut collector = OutputCollector {
            scheduler: self,
            job,
            folder: self.job_dir(&job.id).join(OUT_DIR),
            outputs: Outputs::default(),
            events: Vec::new(),
        };
        job.params.collect(&mut collector).await?;
        let log = self.job_dir(&job.id).join("log.txt");
        collector.add(&self.store.put_file(&job.id, "log.txt", &log).await?);
        let OutputCollector { outputs, events, .. } = collector;
        Ok(JobOutputs { outputs, events })
    }

    /// Stores the checkpoints that a training has written, each in its own immutable folder. The next call
    /// completes an interrupted one.
    pub(super) async fn store_checkpoints(&self, job: &Job) -> Result<(), StoreError> {
        // The next worker may report checkpoints while those of its predecessor are still being stored.
        let _guard = self.checkpoint_lock.lock().await;
        for (step, folder) in pending_checkpoints(&self.job_dir(&job.id).join(OUT_DIR))? {
            // An interrupted deletion can leave parts of a folder that is already stored.
            if step > job.checkpoint_step {
                self.store_checkpoint(job, step, &folder).await?;
            }
            tokio::fs::remove_dir_all(&folder).await?;
        }
        Ok(())
    }

    /// Stores one checkpoint as a model and appends its event once.
    async fn store_checkpoint(
        &self,
        job: &Job,
        step: u64,
        folder: &Path,
    ) -> Result<(), StoreError> {
        let mut files = Vec::new();
        for (_, name) in MODEL_FILES {
            let path = folder.join(name);
            files.push(self.store.put_file(&job.id, &format!("step-{step}/{name}"), &path).await?);
        }
        let id = self.add_model(job, "policy", &files, Some(step)).await?;
        let announce = |job: &mut Job, events: &mut Vec<NewEvent>| {
            if step <= job.checkpoint_step {
                return Ok(());
            }
            job.checkpoint_step = step;
            job.checkpoint_count += 1;
            let data = json!({
                "step": step, "model_id": id, "bytes": files.iter().map(|f| f.bytes).sum::<u64>(),
                "metrics": job.latest_metrics, "demo_url": format!("/?model={id}"),
            });
            events.push(NewEvent::new(EventType::Checkpoint, format!("step {step}"), data));
            Ok::<_, ()>(())
        };
        self.store.update(&job.id, announce).await?;
        Ok(())
    }

    /// Adds a model record for these files. Returns its id, a hash of the weight files.
    async fn add_model(
        &self,
        job: &Job,
        kind: &str,
        files: &[Artifact],
        step: Option<u64>,
    ) -> Result<String, StoreError> {
        let id = model_id(files.iter().map(|file| (file.name.as_str(), file.hash.as_str())));
        let entry = |file: &Artifact| {
            let name = file.name.rsplit('/').next().unwrap_or_default().to_owned();
            (name, json!({ "blake3": file.hash, "bytes": file.bytes }))
        };
        let files: serde_json::Map<String, Value> = files.iter().map(entry).collect();
        let record = json!({
            "id": id, "object": "model", "kind": kind, "job": job.id, "step": step,
            "created_at": Utc::now(), "params": ParamsView(&job.params), "files": files,
        });
        self.store.add_record(RecordKind::Model, &id, &record).await?;
        Ok(id)
    }
}

/// Checkpoints in the output folder that are not stored yet: step and folder, in ascending order.
fn pending_checkpoints(out: &Path) -> io::Result<Vec<(u64, PathBuf)>> {
    let mut checkpoints = Vec::new();
    for entry in std::fs::read_dir(out)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if let Some(step) = name.strip_prefix("step-").and_then(|step| step.parse().ok()) {
            checkpoints.push((step, entry.path()));
        }
    }
    checkpoints.sort();
    Ok(checkpoints)
}

/// Files of a folder, sorted by name.
fn list_files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}
