//! Persistent state of the server: jobs, events and records in one SQLite file, and artifacts.
//!
//! There is one writer. Every change is one short immediate transaction. Its events are committed to the log
//! before subscribers are notified. A reader that resumes from its last event id sees every event exactly
//! once.

mod artifacts;
mod damage;
mod error;
mod events;
mod job_list;
mod jobs;
mod metric_chunks;
mod records;
mod schema;
#[cfg(test)]
mod tests;

pub(crate) use artifacts::{Artifact, content_type};
pub(crate) use error::{StoreError, is_full};
pub(crate) use events::{Event, EventType, Level, NewEvent};
pub(crate) use job_list::Filter;
pub(crate) use jobs::CreateOutcome;
pub(crate) use metric_chunks::{MIN_CHUNK_EVENTS, MetricChunk};
pub(crate) use records::RecordKind;

use chrono::Utc;
use sqlx::Connection;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use std::path::Path;
use std::time::Duration;
use tokio::sync::watch;

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
        let writer = pool(1).connect_with(options.clone()).await?;
        schema::migrate(&writer).await?;
        let readers = pool(4);
        let readers = readers.connect_with(options.read_only(true)).await?;
        let last: i64 = sqlx::query_scalar("SELECT coalesce(max(seq), 0) FROM events")
            .fetch_one(&writer)
            .await?;
        let last = watch::Sender::new(last);
        let store = Self {
            writer,
            readers,
            artifacts: std::sync::Arc::new(artifacts),
            artifact_lock: std::sync::Arc::default(),
            last_event: last,
        };
        store.mark_damaged_jobs().await?;
        Ok(store)
    }

    /// Commits a row. Fails on a full disk, where reading still succeeds and an empty transaction, too.
    pub(crate) async fn check_writable(&self) -> Result<(), StoreError> {
        sqlx::query(
            "INSERT INTO readiness (id, checked_at) VALUES (1, ?)
             ON CONFLICT (id) DO UPDATE SET checked_at = excluded.checked_at",
        )
        .bind(Utc::now().timestamp_millis())
        .execute(&self.writer)
        .await?;
        Ok(())
    }

    /// Begins a write transaction.
    async fn begin_transaction(
        &self,
    ) -> Result<sqlx::Transaction<'static, sqlx::Sqlite>, StoreError> {
        Ok(self.writer.begin_with("BEGIN IMMEDIATE").await?)
    }
}

/// Options of a pool of up to `max` connections.
///
/// If SQLite itself has rolled back a transaction, as on a full disk, the ROLLBACK of sqlx fails, and its
/// connection rejects every later transaction (sqlx 0.9, issue 3932). Such a connection is replaced.
fn pool(max: u32) -> SqlitePoolOptions {
    SqlitePoolOptions::new().max_connections(max).before_acquire(|connection, _| {
        let is_usable = !connection.is_in_transaction();
        Box::pin(async move { Ok(is_usable) })
    })
}
