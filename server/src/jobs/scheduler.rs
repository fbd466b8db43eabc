//! Job scheduler: starts one worker process per job, applies its reports, and collects its outputs.
//!
//! A job has a folder, and its worker may be killed at any moment: the worker writes files atomically and
//! resumes from them. A pause, a cancellation, a crash and a power cut are therefore handled identically. A
//! worker holds the job while it reports. Reports of a former worker are rejected, so that no job finishes
//! twice.

mod control;
mod datasets;
mod deletion;
mod display;
mod estimate;
mod finish;
mod health_alerts;
mod inputs;
mod launch;
mod models;
mod outputs;
mod readiness;
mod reports;
mod start;

pub(crate) use estimate::Estimate;
pub(crate) use outputs::OutputCollector;

use crate::jobs::{DesiredState, Job, Status};
use crate::metrics::Metrics;
use crate::problem::Problem;
use crate::store::{EventType, NewEvent, Store, StoreError};
use chrono::{TimeDelta, Utc};
use health_alerts::HealthMonitor;
use launch::{Launcher, LocalLauncher};
use readiness::{Readiness, RecurringFailure};
use serde_json::json;
use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, oneshot};

/// Configuration of the job scheduler.
#[derive(Clone, Debug)]
pub struct SchedulerConfig {
    /// Data folder: database, artifacts, datasets and job folders.
    pub data_dir: PathBuf,
    /// Folder of the built-in models.
    pub models_dir: PathBuf,
    /// Worker executable: `ngf-worker`.
    pub program: PathBuf,
    /// Whether the executable may not exist yet, because it is being built. Jobs stay queued until it does.
    pub waits_for_program: bool,
    /// Maximum number of jobs that run at a time.
    pub max_concurrent: usize,
    /// Running jobs get an alert when less disk space than this is free (bytes).
    pub min_free_bytes: u64,
}

/// File in the job folder that the worker locks while it runs.
const LOCK_FILE: &str = "lock";

/// Lease: a worker that has not reported for this long is considered lost.
const LEASE: Duration = Duration::from_secs(15);

/// Lease while the server stores outputs or checkpoints of the worker.
const MAX_LEASE: Duration = Duration::from_secs(600);

/// Time that workers of a former server process have to report after a server start.
const ADOPTION_GRACE: Duration = Duration::from_secs(5);

/// Interval at which queued jobs and expired leases are checked.
const POLL_INTERVAL: Duration = Duration::from_millis(500);

/// A longer gap between two polls means that the machine slept or that its clock was set.
const SLEEP_DETECTION: TimeDelta = TimeDelta::seconds(5);

/// Workers that a job may lose in a row, without progress, before it fails.
const MAX_LOST_WORKERS: u64 = 5;

/// Runs queued jobs as worker processes and tracks their state in the store.
#[derive(Debug)]
pub struct JobScheduler {
    pub(crate) store: Store,
    /// Prometheus metrics.
    pub(crate) metrics: Arc<Metrics>,
    config: SchedulerConfig,
    launcher: Box<dyn Launcher>,
    /// URL at which workers reach this server; set by [`JobScheduler::run`].
    server_url: OnceLock<String>,
    /// Kill switches of the workers that this process started, by job id: the attempt and its channel.
    kill_switches: Mutex<HashMap<String, (u64, oneshot::Sender<()>)>>,
    /// Serializes the collection of checkpoints.
    checkpoint_lock: tokio::sync::Mutex<()>,
    readiness: Readiness,
    wake: Notify,
    /// Open lock file: reserves the data folder for this process.
    _lock: File,
}

/// Error while the scheduler opens its data folder.
#[derive(Debug, thiserror::Error)]
pub enum SchedulerError {
    /// The data folder is locked by another server.
    #[error(
        "{0} is in use by another server; stop that one, or choose another folder with --data-dir"
    )]
    InUse(PathBuf),
    /// The data folder cannot be created, read or written.
    #[error("cannot use {0}: {1}")]
    Folder(PathBuf, String),
}

impl JobScheduler {
    /// Opens and locks the data folder and cleans up after a crash. Fails if another server uses the folder.
    pub async fn open(config: SchedulerConfig) -> Result<Arc<Self>, SchedulerError> {
        let data = config.data_dir.clone();
        let failed =
            |error: &dyn std::fmt::Display| SchedulerError::Folder(data.clone(), error.to_string());
        std::fs::create_dir_all(&config.data_dir).map_err(|error| failed(&error))?;
        // Absolute paths, because workers run in their job folder.
        let absolute = std::path::absolute(&config.data_dir).map_err(|error| failed(&error))?;
        let models = std::path::absolute(&config.models_dir).map_err(|error| failed(&error))?;
        let config = SchedulerConfig { data_dir: absolute, models_dir: models, ..config };
        let lock = File::create(config.data_dir.join("lock")).map_err(|error| failed(&error))?;
        lock.try_lock().map_err(|_| SchedulerError::InUse(config.data_dir.clone()))?;
        deletion::remove_trash(&config.data_dir.join("datasets"))
            .map_err(|error| failed(&error))?;
        deletion::remove_incomplete(&config.data_dir.join("artifacts"))
            .map_err(|error| failed(&error))?;
        let store = Store::open(&config.data_dir).await.map_err(|error| failed(&error))?;
        let scheduler = Self {
            store,
            metrics: Arc::new(Metrics::new()),
            launcher: Box::new(LocalLauncher::new(&config.program)),
            config,
            server_url: OnceLock::new(),
            kill_switches: Mutex::default(),
            checkpoint_lock: tokio::sync::Mutex::default(),
            readiness: Readiness::default(),
            wake: Notify::new(),
            _lock: lock,
        };
        // Clients repeat uploads that a former server process did not finish.
        std::fs::remove_dir_all(scheduler.uploads_dir()).ok();
        for folder in [scheduler.uploads_dir(), scheduler.work_dir()] {
            std::fs::create_dir_all(folder).map_err(|error| failed(&error))?;
        }
        scheduler.recover().await.map_err(|error| failed(&error))?;
        Ok(Arc::new(scheduler))
    }

    /// Schedules jobs until the future is dropped. `url`: address at which workers reach this server.
    pub async fn run(self: Arc<Self>, url: &str) {
        self.server_url.set(url.to_owned()).ok();
        // No outputs are being stored yet, so the short lease detects lost workers soon.
        if let Err(error) = self.extend_leases(ADOPTION_GRACE).await {
            tracing::warn!(%error, "cannot extend leases after the start");
        }
        let (mut last_poll, mut health) = (Utc::now(), HealthMonitor::default());
        let mut failure = RecurringFailure::default();
        loop {
            // After a sleep or a clock change no reports arrived, but the workers may be healthy.
            if (Utc::now() - last_poll).abs() > SLEEP_DETECTION {
                self.report_failed();
            }
            last_poll = Utc::now();
            if let Err(error) = self.poll(&mut health).await {
                if error.is_disk_full() {
                    self.report_failed();
                }
                failure.log("cannot schedule jobs", &error);
            }
            tokio::select! {
                () = self.wake.notified() => {}
                () = tokio::time::sleep(POLL_INTERVAL) => {}
            }
        }
    }

    /// One round: recovers leases, schedules jobs, checks the health of running jobs.
    async fn poll(self: &Arc<Self>, health: &mut HealthMonitor) -> Result<(), StoreError> {
        self.recover_leases().await?;
        self.schedule().await?;
        self.check_health(health).await
    }

    /// Kills the workers that this process started. Their jobs resume when the server starts again.
    pub async fn shutdown(&self) {
        let running = self.store.ids_with_status(&[Status::Running]).await.unwrap_or_default();
        for id in running {
            let requeue = |job: &mut Job, events: &mut Vec<NewEvent>| {
                job.status = match job.desired_state {
                    DesiredState::Pause => Status::Paused,
                    _ => Status::Queued,
                };
                events.push(NewEvent::new(
                    EventType::Status,
                    "server shutting down",
                    json!({ "status": job.status }),
                ));
                Ok::<_, Problem>(())
            };
            self.store.update(&id, requeue).await.ok();
        }
        let switches = std::mem::take(&mut *self.kill_switches());
        for (_, kill) in switches.into_values() {
            kill.send(()).ok();
        }
        // Gives the waiting tasks time to kill the workers before the runtime ends.
        tokio::time::sleep(Duration::from_millis(100)).await;
    }

    fn kill_switches(
        &self,
    ) -> std::sync::MutexGuard<'_, HashMap<String, (u64, oneshot::Sender<()>)>> {
        self.kill_switches.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Data folder.
    pub(crate) fn data_dir(&self) -> &Path {
        &self.config.data_dir
    }

    /// Worker executable.
    pub(crate) fn program(&self) -> &Path {
        &self.config.program
    }

    /// Whether jobs can start: the worker executable exists, or is expected to.
    pub(crate) fn has_worker(&self) -> bool {
        !self.config.waits_for_program || self.program().is_file()
    }

    /// Folder of unfinished uploads.
    pub(crate) fn uploads_dir(&self) -> PathBuf {
        self.config.data_dir.join("uploads")
    }

    /// Working folder of a job.
    pub(crate) fn job_dir(&self, id: &str) -> PathBuf {
        self.work_dir().join(id)
    }

    /// Folder that contains the job folders.
    fn work_dir(&self) -> PathBuf {
        self.config.data_dir.join("work")
    }

    /// Folder of the dataset with this hash.
    pub(crate) fn dataset_dir(&self, hash: &str) -> PathBuf {
        self.config.data_dir.join("datasets").join(hash)
    }

    /// Folder of the built-in models.
    pub(crate) fn models_dir(&self) -> &Path {
        &self.config.models_dir
    }

    /// Extends the leases of workers that outlived a server process or a sleep, so that they have time to
    /// report. Longer leases are kept, limited to `max` from now.
    async fn extend_leases(&self, max: Duration) -> Result<(), StoreError> {
        self.store.extend_leases(deadline_ms(ADOPTION_GRACE), deadline_ms(max)).await
    }

    /// Handles lost workers, then starts queued jobs while slots are free.
    async fn schedule(self: &Arc<Self>) -> Result<(), StoreError> {
        for id in self.store.expired_leases().await? {
            self.worker_lost(&id, None).await?;
        }
        if !self.has_worker() {
            return Ok(());
        }
        loop {
            let running =
                self.store.ids_with_status(&[Status::Running, Status::Cancelling]).await?.len();
            if running >= self.config.max_concurrent {
                return Ok(());
            }
            let Some(id) = self.store.next_queued().await? else { return Ok(()) };
            self.start_job(&id).await?;
        }
    }
}

/// Unix time (ms) of a deadline this far from now.
fn deadline_ms(after: Duration) -> i64 {
    (Utc::now() + after).timestamp_millis()
}
