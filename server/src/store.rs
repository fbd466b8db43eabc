//! Persistent state of the server: jobs, events and records in one SQLite file, and artifacts.
//!
//! There is one writer. Every change is one short immediate transaction. Its events are committed to the log
//! before subscribers are notified. A reader that resumes from its last event id sees every event exactly
//! once.

mod artifacts;
mod events;
mod jobs;
mod records;

pub(crate) use artifacts::Artifact;
pub(crate) use events::{Event, EventType, Level, NewEvent};
pub(crate) use jobs::{CreateOutcome, Filter};
pub(crate) use records::RecordKind;

use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use std::path::Path;
use std::time::Duration;
use tokio::sync::watch;

/// Error of the store.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StoreError {
    /// Error of SQLite.
    #[error("database error: {0}")]
    Database(#[from] sqlx::Error),
    /// A record is not the expected JSON.
    #[error("corrupt record in the database: {0}")]
    Corrupt(#[from] serde_json::Error),
    /// A file cannot be read or written.
    #[error("file error: {0}")]
    File(#[from] std::io::Error),
    /// Error of the artifact store.
    #[error("artifact store error: {0}")]
    Artifacts(#[from] object_store::Error),
}

/// Database and artifact store.
#[derive(Clone, Debug)]
pub(crate) struct Store {
    /// One connection: writers queue here instead of competing for the lock of SQLite.
    writer: SqlitePool,
    /// Read-only connections.
    readers: SqlitePool,
    /// Files by hash.
    artifacts: std::sync::Arc<dyn object_store::ObjectStore>,
    /// Held while artifacts are stored or deleted, so that an existing file cannot be deleted before its new
    /// owner is recorded.
    artifact_lock: std::sync::Arc<tokio::sync::Mutex<()>>,
    /// Sequence number of the last event.
    last_event: watch::Sender<i64>,
}

impl Store {
    /// Opens the store in a folder; creates it if necessary.
    pub(crate) async fn open(dir: &Path) -> Result<Self, StoreError> {
        let artifacts = dir.join("artifacts");
        std::fs::create_dir_all(&artifacts)?;
        let artifacts = object_store::local::LocalFileSystem::new_with_prefix(artifacts)?;
        // Files reach the disk before the database refers to them.
        let artifacts = artifacts.with_fsync(true);
        let options = SqliteConnectOptions::new()
            .filename(dir.join("ngf.sqlite"))
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(Duration::from_secs(10));
        let writer = SqlitePoolOptions::new().max_connections(1).connect_with(options.clone());
        let writer = writer.await?;
        sqlx::raw_sql(include_str!("store/schema.sql")).execute(&writer).await?;
        let readers = SqlitePoolOptions::new().max_connections(4);
        let readers = readers.connect_with(options.read_only(true)).await?;
        let last: i64 = sqlx::query_scalar("SELECT coalesce(max(seq), 0) FROM events")
            .fetch_one(&writer)
            .await?;
        let last = watch::Sender::new(last);
        Ok(Self {
            writer,
            readers,
            artifacts: std::sync::Arc::new(artifacts),
            artifact_lock: std::sync::Arc::default(),
            last_event: last,
        })
    }

    /// Whether the database responds.
    pub(crate) async fn is_ready(&self) -> bool {
        sqlx::query("SELECT 1").execute(&self.readers).await.is_ok()
    }

    /// Begins a write transaction.
    async fn begin_transaction(
        &self,
    ) -> Result<sqlx::Transaction<'static, sqlx::Sqlite>, StoreError> {
        Ok(self.writer.begin_with("BEGIN IMMEDIATE").await?)
    }
}
