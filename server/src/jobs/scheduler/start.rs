//! Starting a job: prepare its inputs, launch the worker, await its exit.

use super::launch::LaunchSpec;
use super::{JobScheduler, LEASE, LOCK_FILE, deadline_ms, display};
use crate::jobs::kinds::{InputPaths, OUT_DIR};
use crate::jobs::{DesiredState, Job, JobError, Status};
use crate::store::{EventType, NewEvent, StoreError};
use chrono::Utc;
use serde_json::json;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::sync::oneshot;
use worker_protocol::WorkerConfig;

impl JobScheduler {
    /// Marks a queued job as running and launches its worker.
    pub(super) async fn start_job(self: &Arc<Self>, id: &str) -> Result<(), StoreError> {
        // 244 random bits.
        let half = || uuid::Uuid::new_v4().simple();
        let token = format!("{}{}", half(), half());
        let deadline = deadline_ms(LEASE);
        self.store.grant_lease(id, blake3::hash(token.as_bytes()).as_bytes(), deadline).await?;
        let mark_running = |job: &mut Job, events: &mut Vec<NewEvent>| {
            if job.status != Status::Queued {
                return Err(());
            }
            (job.status, job.desired_state, job.error) = (Status::Running, DesiredState::Run, None);
            job.attempt += 1;
            job.last_report_seq = 0;
            job.started_at.get_or_insert_with(Utc::now);
            let data = json!({ "status": job.status, "attempt": job.attempt });
            events.push(NewEvent::new(EventType::Status, "running", data));
            Ok(())
        };
        let Some(Ok((job, ()))) = self.store.update(id, mark_running).await? else {
            return Ok(());
        };
        tracing::info!(job = id, kind = job.kind().name(), attempt = job.attempt, "job started");
        self.metrics.job_started(&job);
        if let Err(error) = self.spawn(&job, &token).await {
            let error = JobError {
                code: "launch_failed".into(),
                message: format!("cannot start the worker: {error}"),
                param: None,
                hint: Some("check the worker executable and the data folder of the server".into()),
            };
            self.finish(id, job.attempt, Err(error)).await?;
        }
        Ok(())
    }

    /// Launches the worker of a job, and a task that awaits its exit.
    async fn spawn(self: &Arc<Self>, job: &Job, token: &str) -> Result<(), StoreError> {
        let folder = self.job_dir(&job.id);
        std::fs::create_dir_all(folder.join(OUT_DIR))?;
        let dataset = match &job.inputs.dataset_id {
            Some(id) => Some(self.dataset_dir_by_id(id).await?),
            None => None,
        };
        let model = match job.inputs.encoder_id.as_ref().or(job.inputs.model_id.as_ref()) {
            Some(id) => Some(self.model_dir(id, &folder).await?),
            None => None,
        };
        let mesh = match &job.inputs.mesh_id {
            Some(id) => Some(self.mesh_file(id, &folder).await?),
            None => None,
        };
        let inputs = InputPaths {
            dataset: dataset.as_deref(),
            model: model.as_deref(),
            mesh: mesh.as_deref(),
        };
        let url = self.server_url.get().cloned().unwrap_or_default();
        let config = WorkerConfig {
            reports_url: format!("{url}/api/v1/jobs/{}/reports", job.id),
            token: token.to_owned(),
            lock_file: folder.join(LOCK_FILE),
        };
        let worker_config = folder.join("worker.json");
        write_secret(&worker_config, &serde_json::to_vec(&config)?)?;
        let argv = job.params.argv(&inputs);
        let folders =
            [&folder, &self.config.data_dir, &self.config.models_dir].map(PathBuf::as_path);
        let spec = LaunchSpec {
            display: display::display(&argv, &folders),
            argv,
            log_file: folder.join("log.txt"),
            working_dir: folder,
            worker_config,
        };
        let mut process = self.launcher.launch(&spec)?;
        let (kill, killed) = oneshot::channel();
        self.kill_switches().insert(job.id.clone(), (job.attempt, kill));
        let (scheduler, id, attempt) = (self.clone(), job.id.clone(), job.attempt);
        tokio::spawn(async move {
            tokio::select! {
                _ = process.wait() => {}
                // Also when the sender is dropped.
                _ = killed => process.kill().await,
            }
            scheduler.kill_switches().retain(|other, (of, _)| *other != id || *of != attempt);
            if let Err(error) = scheduler.worker_lost(&id, Some(attempt)).await {
                tracing::warn!(job = id, %error, "cannot release the worker");
            }
            scheduler.wake.notify_one();
        });
        Ok(())
    }
}

/// Writes a file that only its owner can read.
fn write_secret(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    use std::io::Write;
    let mut options = File::options();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.mode(0o600);
    }
    options.open(path)?.write_all(bytes)
}
