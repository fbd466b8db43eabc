//! The engine behind jobs: it gives each a process when its turn comes, hears how it goes, and settles what became of
//! it.
//!
//! A job is a folder, and a process in it that may be ended at any moment: it writes what is whole or nothing, and goes
//! on from there. So a pause, a cancellation, a crash and a power cut are the same thing to it. A process counts for as
//! long as it reports; what one says that is no longer the job's is refused, so that no job ends twice.

mod ask;
mod begin;
mod command;
mod end;
mod estimate;
mod forget;
mod hear;
mod launch;
mod report;
mod settle;
mod watch;

pub use crate::job::{Progress, Worker};
pub(crate) use estimate::Estimate;
pub use launch::JOB_FILE;
pub use report::{Answer, Command, Ended, JobFile, Note, Report};

use crate::job::{Job, Status, Wish};
use crate::metrics::Metrics;
use crate::problem::Problem;
use crate::store::{News, Store, StoreError, Type};
use chrono::{TimeDelta, Utc};
use launch::{Launcher, Local};
use serde_json::json;
use std::collections::HashMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, oneshot};
use watch::Watch;

/// How jobs are done.
#[derive(Clone, Debug)]
pub struct EngineConfig {
    /// Folder of everything that is kept.
    pub data: PathBuf,
    /// Folder of the models that were there before.
    pub models: PathBuf,
    /// Program that does the jobs: `ngf`.
    pub program: PathBuf,
    /// Jobs at a time.
    pub places: usize,
    /// With fewer bytes of the disk free, jobs that run get an alert.
    pub free_bytes: u64,
}

/// File in the folder of a job that its process locks.
const LOCK: &str = "lock";

/// A process that is not heard of for so long is taken for dead.
const LEASE: Duration = Duration::from_secs(15);

/// The same while what it made is being kept.
const LONG_LEASE: Duration = Duration::from_secs(600);

/// After a start of the server, processes that are still at work have so long to report.
const ADOPTION: Duration = Duration::from_secs(5);

/// Time between two looks at what waits and what has vanished.
const PACE: Duration = Duration::from_millis(500);

/// Between two looks there is so much time only if the machine slept.
const SLEPT: TimeDelta = TimeDelta::seconds(5);

/// Processes of a job that may vanish in a row, without having come further, before it counts as failed.
const MOST_LOST: u64 = 5;

/// The engine.
#[derive(Debug)]
pub struct Engine {
    pub(crate) store: Store,
    /// What is counted.
    pub(crate) metrics: Arc<Metrics>,
    config: EngineConfig,
    launcher: Box<dyn Launcher>,
    /// Address of the server, once it is known.
    url: OnceLock<String>,
    /// Ends the processes that were started here: of each job the one of an attempt.
    kills: Mutex<HashMap<String, (u64, oneshot::Sender<()>)>>,
    /// Held by whoever takes the models that a training writes on its way.
    taking: tokio::sync::Mutex<()>,
    wake: Notify,
    /// Nobody else may work in the folder while this is open.
    _lock: File,
}

/// Why an engine cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// Another server uses the folder.
    #[error("{0} is in use by another server; stop that one, or choose another folder with --data")]
    InUse(PathBuf),
    /// The folder cannot be used.
    #[error("cannot use {0}: {1}")]
    Folder(PathBuf, String),
}

impl Engine {
    /// Opens the folder of data; refuses one that another server uses.
    pub async fn open(config: EngineConfig) -> Result<Arc<Self>, EngineError> {
        let data = config.data.clone();
        let failed =
            |error: &dyn std::fmt::Display| EngineError::Folder(data.clone(), error.to_string());
        std::fs::create_dir_all(&config.data).map_err(|error| failed(&error))?;
        // A job works in a folder of its own.
        let absolute = std::path::absolute(&config.data).map_err(|error| failed(&error))?;
        let models = std::path::absolute(&config.models).map_err(|error| failed(&error))?;
        let config = EngineConfig { data: absolute, models, ..config };
        let lock = File::create(config.data.join("lock")).map_err(|error| failed(&error))?;
        lock.try_lock().map_err(|_| EngineError::InUse(config.data.clone()))?;
        forget::sweep(&config.data.join("datasets")).map_err(|error| failed(&error))?;
        let store = Store::open(&config.data).await.map_err(|error| failed(&error))?;
        let engine = Self {
            store,
            metrics: Arc::new(Metrics::new()),
            launcher: Box::new(Local::new(&config.program)),
            config,
            url: OnceLock::new(),
            kills: Mutex::default(),
            taking: tokio::sync::Mutex::default(),
            wake: Notify::new(),
            _lock: lock,
        };
        // What was on its way to the server before is sent again.
        std::fs::remove_dir_all(engine.incoming()).ok();
        for folder in [engine.incoming(), engine.work_folder()] {
            std::fs::create_dir_all(folder).map_err(|error| failed(&error))?;
        }
        engine.tidy_up().await.map_err(|error| failed(&error))?;
        Ok(Arc::new(engine))
    }

    /// Works until it is dropped; `url` is where processes find the server.
    pub async fn work(self: Arc<Self>, url: &str) {
        self.url.set(url.to_owned()).ok();
        // Nothing is being kept yet: a process that has vanished meanwhile is noticed soon.
        if let Err(error) = self.adopt(ADOPTION).await {
            tracing::warn!(%error, "jobs that were running");
        }
        let (mut last, mut watch) = (Utc::now(), Watch::default());
        loop {
            // A machine that slept, or whose clock was set, has not heard of its processes, and they are well.
            if (Utc::now() - last).abs() > SLEPT
                && let Err(error) = self.adopt(LONG_LEASE).await
            {
                tracing::warn!(%error, "after a sleep");
            }
            last = Utc::now();
            if let Err(error) = self.look().await {
                tracing::warn!(%error, "looking for jobs");
            }
            if let Err(error) = self.watch(&mut watch).await {
                tracing::warn!(%error, "watching jobs");
            }
            tokio::select! {
                () = self.wake.notified() => {}
                () = tokio::time::sleep(PACE) => {}
            }
        }
    }

    /// Ends the processes that were started here; their jobs go on when the next server begins.
    pub async fn rest(&self) {
        let running = self.store.ids_in(&[Status::Running]).await.unwrap_or_default();
        for id in running {
            let back = |job: &mut Job, news: &mut Vec<News>| {
                job.status = match job.wish {
                    Wish::Pause => Status::Paused,
                    _ => Status::Queued,
                };
                news.push(News::new(
                    Type::Status,
                    "the server stops",
                    json!({ "status": job.status }),
                ));
                Ok::<_, Problem>(())
            };
            self.store.change(&id, back).await.ok();
        }
        let kills = std::mem::take(&mut *self.kills());
        for (_, kill) in kills.into_values() {
            kill.send(()).ok();
        }
        // Their guardians end them before the runtime goes.
        tokio::time::sleep(Duration::from_millis(100)).await;
    }

    fn kills(&self) -> std::sync::MutexGuard<'_, HashMap<String, (u64, oneshot::Sender<()>)>> {
        self.kills.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Folder of everything that is kept.
    pub(crate) fn data(&self) -> &Path {
        &self.config.data
    }

    /// Folder of files on their way here.
    pub(crate) fn incoming(&self) -> PathBuf {
        self.config.data.join("incoming")
    }

    /// Folder of a job.
    pub(crate) fn folder(&self, id: &str) -> PathBuf {
        self.work_folder().join(id)
    }

    /// Folder of the folders of jobs.
    fn work_folder(&self) -> PathBuf {
        self.config.data.join("work")
    }

    /// Folder of a dataset, by its hash.
    pub(crate) fn dataset_folder(&self, hash: &str) -> PathBuf {
        self.config.data.join("datasets").join(hash)
    }

    /// Folder of the models that were there before.
    pub(crate) fn models(&self) -> &Path {
        &self.config.models
    }

    /// Gives processes that outlived the last server, or a sleep, time to report; who has more keeps it, up to `most`.
    async fn adopt(&self, most: Duration) -> Result<(), StoreError> {
        self.store.lease_all(soon(ADOPTION), soon(most)).await
    }

    /// Settles jobs whose process vanished, and begins with those that wait.
    async fn look(self: &Arc<Self>) -> Result<(), StoreError> {
        for id in self.store.expired().await? {
            self.vanished(&id, None).await?;
        }
        loop {
            let busy = self.store.ids_in(&[Status::Running, Status::Cancelling]).await?.len();
            if busy >= self.config.places {
                return Ok(());
            }
            let Some(id) = self.store.next_queued().await? else { return Ok(()) };
            self.begin(&id).await?;
        }
    }
}

/// The time (ms) after so long from now.
fn soon(after: Duration) -> i64 {
    (Utc::now() + after).timestamp_millis()
}
