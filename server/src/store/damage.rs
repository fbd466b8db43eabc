//! Records that cannot be read: a damaged record affects only itself.

use super::{Store, StoreError};
use crate::jobs::Job;
use serde::de::DeserializeOwned;

/// Status column of a job whose record cannot be read. Such a job is not scheduled and not listed.
pub(super) const DAMAGED: &str = "damaged";

/// Number of jobs that are read at a time.
const JOBS_PER_READ: i64 = 500;

/// Parses the record with this id.
pub(super) fn parse<T: DeserializeOwned>(id: &str, record: &str) -> Result<T, StoreError> {
    serde_json::from_str(record).map_err(|error| StoreError::Damaged(id.to_owned(), error))
}

/// Parses a record of a list; logs and omits it if it is damaged.
pub(super) fn parse_listed<T: DeserializeOwned>((id, record): (String, String)) -> Option<T> {
    parse(&id, &record).inspect_err(|error| tracing::error!(%error, "omitted from a list")).ok()
}

impl Store {
    /// Marks jobs whose record cannot be read as damaged, and restores those that this version can read.
    pub(super) async fn mark_damaged_jobs(&self) -> Result<(), StoreError> {
        let mut last = String::new();
        loop {
            let jobs: Vec<(String, String, String)> = sqlx::query_as(
                "SELECT id, status, record FROM jobs WHERE id > ? ORDER BY id LIMIT ?",
            )
            .bind(&last)
            .bind(JOBS_PER_READ)
            .fetch_all(&self.readers)
            .await?;
            let Some((id, ..)) = jobs.last() else { return Ok(()) };
            last.clone_from(id);
            for (id, status, record) in jobs {
                let correct = match parse::<Job>(&id, &record) {
                    Ok(job) if status == DAMAGED => job.status.name(),
                    Ok(_) => continue,
                    Err(error) => {
                        tracing::error!(job = id, %error, "damaged job; DELETE removes it");
                        DAMAGED
                    }
                };
                let update = sqlx::query("UPDATE jobs SET status = ? WHERE id = ?");
                // A full disk does not prevent the start; the job remains unreadable.
                if status != correct
                    && let Err(error) = update.bind(correct).bind(&id).execute(&self.writer).await
                {
                    tracing::error!(job = id, %error, "cannot mark a damaged job");
                }
            }
        }
    }

    /// Whether a job with this id exists, readable or damaged.
    pub(crate) async fn has_job(&self, id: &str) -> Result<bool, StoreError> {
        let row: Option<i64> = sqlx::query_scalar("SELECT 1 FROM jobs WHERE id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        Ok(row.is_some())
    }
}
