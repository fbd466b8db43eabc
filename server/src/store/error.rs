//! Errors of the store.

use std::error::Error;
use std::io;

/// Error of the store.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StoreError {
    /// Error of SQLite.
    #[error("database error: {0}")]
    Database(#[from] sqlx::Error),
    /// The database was written by a newer version: its schema version, and the newest known one.
    #[error(
        "the database was written by a newer version of ngf (schema {0}; this version reads up to {1}); \
         update ngf, or choose another folder with --data-dir"
    )]
    Newer(i64, usize),
    /// The database cannot be updated to the current schema.
    #[error("cannot update the database ngf.sqlite: {0}; restore it from a backup")]
    Migration(sqlx::migrate::MigrateError),
    /// The database lacks these columns, as `TABLE.COLUMN`.
    #[error("the database ngf.sqlite lacks {0}; restore it from a backup")]
    MissingColumns(String),
    /// The record with this id cannot be read.
    #[error("the record of {0} cannot be read: {1}")]
    Damaged(String, serde_json::Error),
    /// JSON of a worker, or for the database, is invalid.
    #[error("invalid JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A file cannot be read or written.
    #[error("file error: {0}")]
    File(#[from] io::Error),
    /// Error of the artifact store.
    #[error("artifact store error: {0}")]
    Artifacts(#[from] object_store::Error),
}

/// Result codes of SQLite on a full disk: SQLITE_FULL, and SQLITE_IOERR_SHMSIZE for the index of its log.
const FULL_CODES: [&str; 2] = ["13", "4874"];

impl StoreError {
    /// Whether the cause is a full disk, or an exhausted disk quota.
    pub(crate) fn is_disk_full(&self) -> bool {
        match self {
            Self::Database(error) => is_full_database(error),
            Self::Migration(error) => {
                error.source().and_then(|e| e.downcast_ref()).is_some_and(is_full_database)
            }
            Self::File(error) => is_full(error),
            Self::Artifacts(error) => {
                let mut cause = error.source();
                while let Some(error) = cause {
                    if error.downcast_ref().is_some_and(is_full) {
                        return true;
                    }
                    cause = error.source();
                }
                false
            }
            _ => false,
        }
    }
}

/// Whether an error of SQLite is caused by a full disk.
fn is_full_database(error: &sqlx::Error) -> bool {
    match error {
        sqlx::Error::Database(error) => {
            error.code().is_some_and(|code| FULL_CODES.contains(&code.as_ref()))
        }
        sqlx::Error::Io(error) => is_full(error),
        _ => false,
    }
}

/// Whether a file cannot be written because the disk is full or the disk quota is exhausted.
pub(crate) fn is_full(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded)
}
