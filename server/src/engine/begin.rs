//! How a job begins: what it is given, the process that does it, and somebody who waits for that one's end.

use super::command::{self, Given};
use super::launch::Order;
use super::{Engine, JobFile, LEASE, LOCK, soon};
use crate::job::{Failure, Job, Status, Wish};
use crate::store::{News, StoreError, Type};
use chrono::Utc;
use serde_json::json;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::sync::oneshot;

impl Engine {
    /// Gives a job a process.
    pub(super) async fn begin(self: &Arc<Self>, id: &str) -> Result<(), StoreError> {
        // 244 random bits.
        let half = || uuid::Uuid::new_v4().simple();
        let token = format!("{}{}", half(), half());
        let until = soon(LEASE);
        self.store.lease(id, blake3::hash(token.as_bytes()).as_bytes(), until).await?;
        let run = |job: &mut Job, news: &mut Vec<News>| {
            if job.status != Status::Queued {
                return Err(());
            }
            (job.status, job.wish, job.error) = (Status::Running, Wish::Run, None);
            job.attempt += 1;
            job.heard = 0;
            job.started_at.get_or_insert_with(Utc::now);
            let data = json!({ "status": job.status, "attempt": job.attempt });
            news.push(News::new(Type::Status, "running", data));
            Ok(())
        };
        let Some(Ok((job, ()))) = self.store.change(id, run).await? else { return Ok(()) };
        tracing::info!(job = id, kind = job.kind.name(), attempt = job.attempt, "begins");
        self.metrics.begun(&job);
        if let Err(error) = self.start(&job, &token).await {
            let failure = Failure {
                code: "launch_failed".into(),
                message: format!("the process could not be started: {error}"),
                param: None,
                hint: Some("look at the program and the data folder of the server".into()),
            };
            self.end(id, job.attempt, Err(failure)).await?;
        }
        Ok(())
    }

    /// Starts the process of a job, and somebody who waits for its end.
    async fn start(self: &Arc<Self>, job: &Job, token: &str) -> Result<(), StoreError> {
        let folder = self.folder(&job.id);
        std::fs::create_dir_all(folder.join(command::OUT))?;
        let dataset = match &job.inputs.dataset_id {
            Some(id) => Some(self.dataset_path(id).await?),
            None => None,
        };
        let model = match job.inputs.encoder_id.as_ref().or(job.inputs.model_id.as_ref()) {
            Some(id) => Some(self.model_folder(id, &folder).await?),
            None => None,
        };
        let mesh = match &job.inputs.mesh_id {
            Some(id) => Some(self.mesh_file(id, &folder).await?),
            None => None,
        };
        let given =
            Given { dataset: dataset.as_deref(), model: model.as_deref(), mesh: mesh.as_deref() };
        let url = self.url.get().cloned().unwrap_or_default();
        let told = JobFile {
            url: format!("{url}/api/v1/jobs/{}/reports", job.id),
            token: token.to_owned(),
            lock: folder.join(LOCK),
        };
        let job_file = folder.join("job.json");
        write_secret(&job_file, &serde_json::to_vec(&told)?)?;
        let arguments = command::arguments(&job.params, &given);
        let folders = [&folder, &self.config.data, &self.config.models].map(PathBuf::as_path);
        let order = Order {
            words: command::words(&arguments, &folders),
            arguments,
            log: folder.join("log.txt"),
            folder,
            job_file,
        };
        let mut process = self.launcher.start(&order)?;
        let (kill, killed) = oneshot::channel();
        self.kills().insert(job.id.clone(), (job.attempt, kill));
        let (engine, id, attempt) = (self.clone(), job.id.clone(), job.attempt);
        tokio::spawn(async move {
            tokio::select! {
                _ = process.ended() => {}
                // Also if the sender is gone.
                _ = killed => process.kill().await,
            }
            engine.kills().retain(|other, (of, _)| *other != id || *of != attempt);
            if let Err(error) = engine.vanished(&id, Some(attempt)).await {
                tracing::warn!(job = id, %error, "settling");
            }
            engine.wake.notify_one();
        });
        Ok(())
    }
}

/// Writes a file that only its owner reads.
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
