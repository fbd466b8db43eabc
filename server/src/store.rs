//! What the server remembers: jobs, events, records of what came of them. One SQLite file.
//!
//! There is one writer. Every change is one short immediate transaction, and what it says happened stands in the log
//! before anyone is told: whoever reads the log from where they stopped misses nothing and gets nothing twice.

mod artifacts;
mod events;
mod jobs;
mod records;

pub(crate) use artifacts::Artifact;
pub(crate) use events::{Event, Level, News, Type};
pub(crate) use jobs::{Created, Filter};
pub(crate) use records::RecordKind;

use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use std::path::Path;
use std::time::Duration;
use tokio::sync::watch;

/// What can go wrong with the store.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StoreError {
    /// SQLite says so.
    #[error("the database: {0}")]
    Database(#[from] sqlx::Error),
    /// Something in it is not what was written.
    #[error("a record in the database is damaged: {0}")]
    Damaged(#[from] serde_json::Error),
    /// A file could not be read or written.
    #[error("a file: {0}")]
    File(#[from] std::io::Error),
    /// The store of artifacts says so.
    #[error("the artifacts: {0}")]
    Artifacts(#[from] object_store::Error),
}

/// The database and the artifacts.
#[derive(Clone, Debug)]
pub(crate) struct Store {
    /// One connection, so that writers wait for each other here and not in SQLite.
    writer: SqlitePool,
    readers: SqlitePool,
    artifacts: std::sync::Arc<dyn object_store::ObjectStore>,
    /// Held while files are kept or forgotten: what is found to be there stays until it is written down whose it is.
    keeping: std::sync::Arc<tokio::sync::Mutex<()>>,
    /// Number of the last event.
    last: watch::Sender<i64>,
}

impl Store {
    /// Opens the store in a folder, and makes it if there is none.
    pub(crate) async fn open(dir: &Path) -> Result<Self, StoreError> {
        let artifacts = dir.join("artifacts");
        std::fs::create_dir_all(&artifacts)?;
        let artifacts = object_store::local::LocalFileSystem::new_with_prefix(artifacts)?;
        // What the database knows of is on the disk.
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
            keeping: std::sync::Arc::default(),
            last,
        })
    }

    /// Whether it answers.
    pub(crate) async fn is_ready(&self) -> bool {
        sqlx::query("SELECT 1").execute(&self.readers).await.is_ok()
    }

    /// Begins a change.
    async fn begin(&self) -> Result<sqlx::Transaction<'static, sqlx::Sqlite>, StoreError> {
        Ok(self.writer.begin_with("BEGIN IMMEDIATE").await?)
    }
}
