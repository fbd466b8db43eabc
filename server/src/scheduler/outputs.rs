//! Outputs of jobs: stores their files as artifacts, datasets and models. Inputs of jobs: paths of datasets,
//! models and meshes.

use super::{JobScheduler, argv};
use crate::job::{Job, Kind, Outputs};
use crate::model::JOB_MODEL_PREFIX;
use crate::store::{Artifact, EventType, NewEvent, RecordKind, StoreError};
use chrono::Utc;
use dataset::Manifest;
use serde_json::{Value, json};
use std::io;
use std::path::{Path, PathBuf};

/// Outputs of a job, and the events that announce them.
#[derive(Debug, Default)]
pub(super) struct JobOutputs {
    pub(super) outputs: Outputs,
    pub(super) events: Vec<NewEvent>,
}

impl JobOutputs {
    fn add(&mut self, artifact: &Artifact) {
        self.outputs.artifact_ids.push(artifact.hash.clone());
        self.events.push(NewEvent::new(
            EventType::Artifact,
            artifact.name.clone(),
            json!(artifact),
        ));
    }
}

/// Whether a file is internal to the worker: a training checkpoint or an incomplete file.
fn is_internal(name: &str) -> bool {
    name.contains("checkpoint") || name.contains(".part-")
}

impl JobScheduler {
    /// Stores all outputs of a job whose worker succeeded.
    pub(super) async fn collect_outputs(&self, job: &Job) -> Result<JobOutputs, StoreError> {
        let out = self.job_dir(&job.id).join(argv::OUT_DIR);
        let mut collected = JobOutputs::default();
        match job.kind {
            Kind::DatasetGenerate => {
                collected.outputs.dataset_id = Some(self.adopt_dataset(job, &out).await?);
            }
            Kind::EncoderTrain | Kind::PolicyTrain => {
                self.store_checkpoints(job).await?;
                let files = self.store_files(job, &out, &mut collected).await?;
                let kind = if job.kind == Kind::EncoderTrain { "encoder" } else { "policy" };
                let id = self.add_model(job, kind, &files, None).await?;
                collected.outputs.model_id = Some(id);
            }
            Kind::PolicyEvaluate => {
                self.store_files(job, &out, &mut collected).await?;
                self.add_evaluation(job, &out).await?;
            }
            Kind::MeshPrepare => {
                self.store_files(job, &out, &mut collected).await?;
            }
        }
        let log = self.job_dir(&job.id).join("log.txt");
        collected.add(&self.store.put_file(&job.id, "log.txt", &log).await?);
        Ok(collected)
    }

    /// Stores every file of a folder as an artifact, except internal ones.
    async fn store_files(
        &self,
        job: &Job,
        out: &Path,
        collected: &mut JobOutputs,
    ) -> Result<Vec<Artifact>, StoreError> {
        let mut artifacts = Vec::new();
        for path in list_files(out)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if !is_internal(&name) {
                let artifact = self.store.put_file(&job.id, &name, &path).await?;
                collected.add(&artifact);
                artifacts.push(artifact);
            }
        }
        Ok(artifacts)
    }

    /// Moves a generated dataset to the dataset folder, adds its record, and returns its id.
    async fn adopt_dataset(&self, job: &Job, out: &Path) -> Result<String, StoreError> {
        // Idempotent: if the server is killed between two steps, the worker repeats its report.
        let hash_file = self.job_dir(&job.id).join("dataset");
        let hash = match Manifest::read(out) {
            Ok(manifest) => {
                tokio::fs::write(&hash_file, &manifest.hash).await?;
                manifest.hash
            }
            Err(error) => {
                let hash = tokio::fs::read_to_string(&hash_file).await;
                hash.map_err(|_| io::Error::other(error))?
            }
        };
        let folder = self.dataset_dir(&hash);
        tokio::fs::create_dir_all(folder.parent().unwrap_or(&folder)).await?;
        // Another job may generate the same dataset at the same time.
        let moved = out.exists() && tokio::fs::rename(out, &folder).await.is_ok();
        let manifest = Manifest::read(&folder).map_err(io::Error::other)?;
        if !moved && out.exists() {
            tokio::fs::remove_dir_all(out).await?;
        }
        let summary: Value =
            serde_json::from_slice(&tokio::fs::read(folder.join("summary.json")).await?)?;
        let id = format!("ds_{}", &manifest.hash[..16]);
        let record = json!({
            "id": id, "object": "dataset", "hash": manifest.hash, "bytes": manifest.total_bytes(),
            "job": job.id, "created_at": Utc::now(), "config": manifest.provenance.config,
            "summary": summary,
        });
        self.store.add_record(RecordKind::Dataset, &id, &record).await?;
        Ok(id)
    }

    /// Stores the checkpoints that a training has written, each in its own immutable folder. The next call
    /// completes an interrupted one.
    pub(super) async fn store_checkpoints(&self, job: &Job) -> Result<(), StoreError> {
        // The next worker may report checkpoints while those of its predecessor are still being stored.
        let _guard = self.checkpoint_lock.lock().await;
        for (step, folder) in pending_checkpoints(&self.job_dir(&job.id).join(argv::OUT_DIR))? {
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
        for name in MODEL_FILES {
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
        let mut hasher = blake3::Hasher::new();
        for file in files.iter().filter(|file| file.name.ends_with(".safetensors")) {
            hasher.update(file.hash.as_bytes());
        }
        let id = format!("{JOB_MODEL_PREFIX}{}", &hasher.finalize().to_hex()[..16]);
        let entry = |file: &Artifact| {
            let name = file.name.rsplit('/').next().unwrap_or_default().to_owned();
            (name, json!({ "blake3": file.hash, "bytes": file.bytes }))
        };
        let files: serde_json::Map<String, Value> = files.iter().map(entry).collect();
        let record = json!({
            "id": id, "object": "model", "kind": kind, "job": job.id, "step": step,
            "created_at": Utc::now(), "params": job.params, "files": files,
        });
        self.store.add_record(RecordKind::Model, &id, &record).await?;
        Ok(id)
    }

    /// Adds the reports of an evaluation as a record of its model, and counts its attempts.
    async fn add_evaluation(&self, job: &Job, out: &Path) -> Result<(), StoreError> {
        let mut reports: Value =
            serde_json::from_slice(&tokio::fs::read(out.join(argv::REPORT_FILE)).await?)?;
        for report in reports.as_array_mut().into_iter().flatten() {
            let failures = report["failures"].as_object().into_iter().flatten();
            let outcomes = failures.map(|(reason, count)| (reason.as_str(), count));
            for (outcome, count) in outcomes.chain([("lifted", &report["lifted"])]) {
                self.metrics.count_attempts(outcome, count.as_u64().unwrap_or_default());
            }
            // The record omits the single attempts; the artifact contains them.
            report.as_object_mut().map(|report| report.remove("rows"));
        }
        // The planner has no model record.
        let Some(model) = &job.inputs.model_id else { return Ok(()) };
        let id = format!("evl_{}", job.id.trim_start_matches("job_"));
        let record = json!({
            "id": id, "object": "evaluation", "model_id": model, "job": job.id,
            "created_at": Utc::now(), "reports": reports,
        });
        self.store.add_record(RecordKind::Evaluation, &id, &record).await
    }

    /// Whether a built-in or trained model with this id exists.
    pub(crate) async fn has_model(&self, id: &str) -> Result<bool, StoreError> {
        if crate::model::is_valid_id(id)
            && self.models_dir().join(id).join(MODEL_FILES[0]).is_file()
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

/// Files of a policy, weights first.
const MODEL_FILES: [&str; 3] =
    ["weights.safetensors", "start_configurations.safetensors", "config.json"];

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
