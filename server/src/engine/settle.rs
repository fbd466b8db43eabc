//! What came of a job: its files become artifacts, a dataset or a model.

use super::{Engine, command};
use crate::job::{Job, Kind, Outputs};
use crate::model::OF_JOB;
use crate::store::{Artifact, News, RecordKind, StoreError, Type};
use chrono::Utc;
use dataset::Manifest;
use serde_json::{Value, json};
use std::io;
use std::path::{Path, PathBuf};

/// What came of a job, and what to write down of it.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) outputs: Outputs,
    pub(super) news: Vec<News>,
}

impl Found {
    fn add(&mut self, artifact: &Artifact) {
        self.outputs.artifact_ids.push(artifact.hash.clone());
        self.news.push(News::new(Type::Artifact, artifact.name.clone(), json!(artifact)));
    }
}

/// Files that a training needs for itself.
fn is_inner(name: &str) -> bool {
    name.contains("checkpoint") || name.contains(".part-")
}

impl Engine {
    /// Takes what a job's process has made.
    pub(super) async fn settle(&self, job: &Job) -> Result<Found, StoreError> {
        let out = self.folder(&job.id).join(command::OUT);
        let mut found = Found::default();
        match job.kind {
            Kind::DatasetGenerate => {
                found.outputs.dataset_id = Some(self.take_dataset(job, &out).await?);
            }
            Kind::EncoderTrain | Kind::PolicyTrain => {
                self.take_checkpoints(job).await?;
                let files = self.keep_all(job, &out, &mut found).await?;
                let kind = if job.kind == Kind::EncoderTrain { "encoder" } else { "policy" };
                let id = self.add_model(job, kind, &files, None).await?;
                found.outputs.model_id = Some(id);
            }
            Kind::PolicyEvaluate => {
                self.keep_all(job, &out, &mut found).await?;
                self.add_evaluation(job, &out).await?;
            }
            Kind::MeshPrepare => {
                self.keep_all(job, &out, &mut found).await?;
            }
        }
        let log = self.folder(&job.id).join("log.txt");
        found.add(&self.store.keep(&job.id, "log.txt", &log).await?);
        Ok(found)
    }

    /// Keeps every file of a folder that is for others.
    async fn keep_all(
        &self,
        job: &Job,
        out: &Path,
        found: &mut Found,
    ) -> Result<Vec<Artifact>, StoreError> {
        let mut artifacts = Vec::new();
        for path in files(out)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if !is_inner(&name) {
                let artifact = self.store.keep(&job.id, &name, &path).await?;
                found.add(&artifact);
                artifacts.push(artifact);
            }
        }
        Ok(artifacts)
    }

    /// Moves a dataset to where datasets are; gives its id.
    async fn take_dataset(&self, job: &Job, out: &Path) -> Result<String, StoreError> {
        // The server may be killed between any two of these lines, and is told again.
        let taken = self.folder(&job.id).join("dataset");
        let hash = match Manifest::read(out) {
            Ok(manifest) => {
                tokio::fs::write(&taken, &manifest.hash).await?;
                manifest.hash
            }
            Err(error) => {
                let taken = tokio::fs::read_to_string(&taken).await;
                taken.map_err(|_| io::Error::other(error))?
            }
        };
        let place = self.dataset_folder(&hash);
        tokio::fs::create_dir_all(place.parent().unwrap_or(&place)).await?;
        // Another job may have made the same, even at this moment.
        let moved = out.exists() && tokio::fs::rename(out, &place).await.is_ok();
        let manifest = Manifest::read(&place).map_err(io::Error::other)?;
        if !moved && out.exists() {
            tokio::fs::remove_dir_all(out).await?;
        }
        let summary: Value =
            serde_json::from_slice(&tokio::fs::read(place.join("summary.json")).await?)?;
        let id = format!("ds_{}", &manifest.hash[..16]);
        let record = json!({
            "id": id, "object": "dataset", "hash": manifest.hash, "bytes": manifest.bytes(),
            "job": job.id, "created_at": Utc::now(), "config": manifest.inputs.config,
            "summary": summary,
        });
        self.store.add_record(RecordKind::Dataset, &id, &record).await?;
        Ok(id)
    }

    /// Takes the models that a training has written on its way, each in a folder of its own that does not change. Whatever
    /// is interrupted here, by the end of the process or of the server, is done when it is next called.
    pub(super) async fn take_checkpoints(&self, job: &Job) -> Result<(), StoreError> {
        // A process may have ended while the server did what it had asked for, and the next one asks already.
        let _alone = self.taking.lock().await;
        for (step, folder) in checkpoints(&self.folder(&job.id).join(command::OUT))? {
            // What is taken already may lie there in part, where its removal was interrupted.
            if step > job.checkpoint_step {
                self.keep_checkpoint(job, step, &folder).await?;
            }
            tokio::fs::remove_dir_all(&folder).await?;
        }
        Ok(())
    }

    /// Keeps one of them, and says so once.
    async fn keep_checkpoint(&self, job: &Job, step: u64, folder: &Path) -> Result<(), StoreError> {
        let mut files = Vec::new();
        for name in MODEL_FILES {
            let path = folder.join(name);
            files.push(self.store.keep(&job.id, &format!("step-{step}/{name}"), &path).await?);
        }
        let id = self.add_model(job, "policy", &files, Some(step)).await?;
        let told = |job: &mut Job, news: &mut Vec<News>| {
            if step <= job.checkpoint_step {
                return Ok(());
            }
            job.checkpoint_step = step;
            job.checkpoint_count += 1;
            let data = json!({
                "step": step, "model_id": id, "bytes": files.iter().map(|f| f.bytes).sum::<u64>(),
                "metrics": job.latest_metrics, "demo_url": format!("/?model={id}"),
            });
            news.push(News::new(Type::Checkpoint, format!("step {step}"), data));
            Ok::<_, ()>(())
        };
        self.store.change(&job.id, told).await?;
        Ok(())
    }

    /// Adds a model of these files; gives its id, which follows from their contents.
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
        let id = format!("{OF_JOB}{}", &hasher.finalize().to_hex()[..16]);
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

    /// Adds what an evaluation counted to what is known of its model.
    async fn add_evaluation(&self, job: &Job, out: &Path) -> Result<(), StoreError> {
        let mut reports: Value =
            serde_json::from_slice(&tokio::fs::read(out.join(command::REPORT)).await?)?;
        for report in reports.as_array_mut().into_iter().flatten() {
            let failures = report["failures"].as_object().into_iter().flatten();
            let ends = failures.map(|(reason, count)| (reason.as_str(), count));
            for (outcome, count) in ends.chain([("lifted", &report["lifted"])]) {
                self.metrics.attempted(outcome, count.as_u64().unwrap_or_default());
            }
            // The attempts are in the artifact.
            report.as_object_mut().map(|report| report.remove("rows"));
        }
        // The planner is no model.
        let Some(model) = &job.inputs.model_id else { return Ok(()) };
        let id = format!("evl_{}", job.id.trim_start_matches("job_"));
        let record = json!({
            "id": id, "object": "evaluation", "model_id": model, "job": job.id,
            "created_at": Utc::now(), "reports": reports,
        });
        self.store.add_record(RecordKind::Evaluation, &id, &record).await
    }

    /// Whether there is a model of this id, of a job or from before.
    pub(crate) async fn has_model(&self, id: &str) -> Result<bool, StoreError> {
        if crate::model::is_id(id) && self.models().join(id).join(MODEL_FILES[0]).is_file() {
            return Ok(true);
        }
        Ok(self.store.record(RecordKind::Model, id).await?.is_some())
    }

    /// A folder with the files of a model: its own, or copies in the folder of a job.
    pub(super) async fn model_folder(
        &self,
        id: &str,
        folder: &Path,
    ) -> Result<PathBuf, StoreError> {
        if !id.starts_with(OF_JOB) {
            return Ok(self.models().join(id));
        }
        let record = self.store.record(RecordKind::Model, id).await?;
        let gone = || io::Error::other(format!("the model {id} was deleted"));
        let record = record.ok_or_else(gone)?;
        let copies = folder.join("in").join(id);
        for (name, file) in record["files"].as_object().into_iter().flatten() {
            let hash = file["blake3"].as_str().unwrap_or_default();
            if !copies.join(name).exists() {
                self.store.copy_to(hash, &copies.join(name)).await?;
            }
        }
        Ok(copies)
    }

    /// A copy of a mesh in the folder of a job, under the name that the object will have.
    pub(super) async fn mesh_file(&self, id: &str, folder: &Path) -> Result<PathBuf, StoreError> {
        let path = folder.join("in").join(format!("{id}.mesh"));
        if !path.exists() {
            let record = self.store.record(RecordKind::Mesh, id).await?;
            let gone = || io::Error::other(format!("the mesh {id} was deleted"));
            let record = record.ok_or_else(gone)?;
            self.store.copy_to(record["hash"].as_str().unwrap_or_default(), &path).await?;
        }
        Ok(path)
    }

    /// Folder of a dataset.
    pub(super) async fn dataset_path(&self, id: &str) -> Result<PathBuf, StoreError> {
        let record = self.store.record(RecordKind::Dataset, id).await?;
        let gone = || io::Error::other(format!("the dataset {id} was deleted"));
        let record = record.ok_or_else(gone)?;
        Ok(self.dataset_folder(record["hash"].as_str().unwrap_or_default()))
    }
}

/// Files that make a policy, weights first.
const MODEL_FILES: [&str; 3] = ["weights.safetensors", "starts.safetensors", "config.json"];

/// The models that a training has written on its way and that are not taken yet: steps and folders, in order.
fn checkpoints(out: &Path) -> io::Result<Vec<(u64, PathBuf)>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(out)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if let Some(step) = name.strip_prefix("step-").and_then(|step| step.parse().ok()) {
            found.push((step, entry.path()));
        }
    }
    found.sort();
    Ok(found)
}

/// Files of a folder, by name.
fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
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
