//! Jobs: queries, updates, leases and idempotency keys.

use super::damage::parse;
use super::events::{self, EventType, NewEvent};
use super::{Store, StoreError, metric_chunks};
use crate::jobs::{Job, Status};
use chrono::Utc;
use serde_json::{Value, json};
use sqlx::{Row, Sqlite, Transaction};

/// Result of a creation request with an idempotency key.
#[derive(Debug)]
pub(crate) enum CreateOutcome {
    /// A new job was created.
    Created(Job),
    /// The same request created this job before.
    Replayed(Job),
    /// The key was used for a different request.
    KeyConflict,
    /// The job created with the key was deleted.
    JobDeleted,
}

/// Lifetime of an idempotency key (ms).
const IDEMPOTENCY_TTL_MS: i64 = 24 * 3600 * 1000;

/// Current Unix time (ms).
fn now() -> i64 {
    Utc::now().timestamp_millis()
}

/// Inserts or replaces a job.
async fn write_job(
    transaction: &mut Transaction<'static, Sqlite>,
    job: &Job,
) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO jobs (id, kind, status, priority, lease_until, record) VALUES (?, ?, ?, ?, 0, ?)
         ON CONFLICT (id) DO UPDATE
         SET status = excluded.status, priority = excluded.priority, record = excluded.record",
    )
    .bind(&job.id)
    .bind(job.kind().name())
    .bind(job.status.name())
    .bind(job.priority)
    .bind(serde_json::to_string(job)?)
    .execute(&mut **transaction)
    .await?;
    Ok(())
}

/// Replaces the metadata of a job in the table that filters of lists read.
async fn write_metadata(
    transaction: &mut Transaction<'static, Sqlite>,
    job: &Job,
) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM job_metadata WHERE job = ?")
        .bind(&job.id)
        .execute(&mut **transaction)
        .await?;
    for (key, value) in &job.metadata {
        sqlx::query(
            "INSERT INTO job_metadata (key, value, job, kind, status) VALUES (?, ?, ?, ?, ?)",
        )
        .bind(key)
        .bind(value.as_str().unwrap_or_default())
        .bind(&job.id)
        .bind(job.kind().name())
        .bind(job.status.name())
        .execute(&mut **transaction)
        .await?;
    }
    Ok(())
}

/// Reads a job inside a transaction.
async fn read_job(
    transaction: &mut Transaction<'static, Sqlite>,
    id: &str,
) -> Result<Option<Job>, StoreError> {
    let record: Option<String> = sqlx::query_scalar("SELECT record FROM jobs WHERE id = ?")
        .bind(id)
        .fetch_optional(&mut **transaction)
        .await?;
    record.map(|record| parse(id, &record)).transpose()
}

/// Result of an earlier request with this key; `None` if the key is unused or expired.
async fn find_idempotent(
    transaction: &mut Transaction<'static, Sqlite>,
    key: &str,
    body_hash: &str,
) -> Result<Option<CreateOutcome>, StoreError> {
    let text = "SELECT body_hash, job FROM idempotency_keys WHERE key = ? AND created_at >= ?";
    let row = sqlx::query(text)
        .bind(key)
        .bind(now() - IDEMPOTENCY_TTL_MS)
        .fetch_optional(&mut **transaction)
        .await?;
    let Some(row) = row else { return Ok(None) };
    if row.try_get::<String, _>("body_hash")? != body_hash {
        return Ok(Some(CreateOutcome::KeyConflict));
    }
    let id: String = row.try_get("job")?;
    Ok(Some(
        read_job(transaction, &id)
            .await?
            .map_or(CreateOutcome::JobDeleted, CreateOutcome::Replayed),
    ))
}

/// Record without the fields that clients cannot observe.
fn public_fields(mut record: Value) -> Value {
    record.as_object_mut().map(|fields| fields.remove("last_report_seq"));
    record
}

impl Store {
    /// Result of an earlier request with this key and body hash; `None` without a key or if it is unused.
    pub(crate) async fn find_idempotent(
        &self,
        key: Option<(&str, &str)>,
    ) -> Result<Option<CreateOutcome>, StoreError> {
        let Some((key, body_hash)) = key else { return Ok(None) };
        find_idempotent(&mut self.begin_transaction().await?, key, body_hash).await
    }

    /// Creates a job, once per idempotency key. `key`: the key and the hash of the request body.
    pub(crate) async fn create(
        &self,
        job: &Job,
        key: Option<(&str, &str)>,
    ) -> Result<CreateOutcome, StoreError> {
        let mut transaction = self.begin_transaction().await?;
        if let Some((key, body_hash)) = key {
            sqlx::query("DELETE FROM idempotency_keys WHERE created_at < ?")
                .bind(now() - IDEMPOTENCY_TTL_MS)
                .execute(&mut *transaction)
                .await?;
            if let Some(outcome) = find_idempotent(&mut transaction, key, body_hash).await? {
                return Ok(outcome);
            }
            sqlx::query(
                "INSERT INTO idempotency_keys (key, body_hash, job, created_at) VALUES (?, ?, ?, ?)",
            )
            .bind(key)
            .bind(body_hash)
            .bind(&job.id)
            .bind(now())
            .execute(&mut *transaction)
            .await?;
        }
        write_job(&mut transaction, job).await?;
        write_metadata(&mut transaction, job).await?;
        let event = NewEvent::new(EventType::Status, "queued", json!({ "status": job.status }));
        let last = events::append(&mut transaction, &job.id, &[event]).await?;
        transaction.commit().await?;
        self.notify(last);
        Ok(CreateOutcome::Created(job.clone()))
    }

    /// The job with this id.
    pub(crate) async fn job(&self, id: &str) -> Result<Option<Job>, StoreError> {
        let record: Option<String> = sqlx::query_scalar("SELECT record FROM jobs WHERE id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        record.map(|record| parse(id, &record)).transpose()
    }

    /// Updates a job and appends its events in one transaction; `None` if the job does not exist. If `change`
    /// returns an error, nothing is written.
    pub(crate) async fn update<T, E>(
        &self,
        id: &str,
        change: impl FnOnce(&mut Job, &mut Vec<NewEvent>) -> Result<T, E>,
    ) -> Result<Option<Result<(Job, T), E>>, StoreError> {
        let mut transaction = self.begin_transaction().await?;
        let Some(mut job) = read_job(&mut transaction, id).await? else { return Ok(None) };
        let mut events = Vec::new();
        let before = serde_json::to_value(&job)?;
        let value = match change(&mut job, &mut events) {
            Ok(value) => value,
            Err(error) => return Ok(Some(Err(error))),
        };
        let after = serde_json::to_value(&job)?;
        let is_visible = public_fields(after.clone()) != public_fields(before.clone());
        if is_visible {
            job.revision += 1;
            job.updated_at = Utc::now();
        }
        if after != before {
            write_job(&mut transaction, &job).await?;
        }
        if after["metadata"] != before["metadata"] {
            write_metadata(&mut transaction, &job).await?;
        }
        let last = events::append(&mut transaction, id, &events).await?;
        if events.iter().any(|event| event.kind == EventType::Metric) {
            metric_chunks::copy_events(&mut transaction, id).await?;
        }
        transaction.commit().await?;
        match last {
            Some(_) => self.notify(last),
            // Without an event, clients may still wait for the change.
            None if is_visible => self.last_event.send_modify(|_| {}),
            None => {}
        }
        Ok(Some(Ok((job, value))))
    }

    /// Id of the queued job that starts next: highest priority, then oldest.
    pub(crate) async fn next_queued(&self) -> Result<Option<String>, StoreError> {
        Ok(sqlx::query_scalar(
            "SELECT id FROM jobs WHERE status = 'queued' ORDER BY priority DESC, id LIMIT 1",
        )
        .fetch_optional(&self.readers)
        .await?)
    }

    /// Ids of the jobs in one of these statuses, newest first.
    pub(crate) async fn ids_with_status(
        &self,
        status: &[Status],
    ) -> Result<Vec<String>, StoreError> {
        let names: Vec<&str> = status.iter().map(|status| status.name()).collect();
        Ok(sqlx::query_scalar(
            "SELECT id FROM jobs WHERE status IN (SELECT value FROM json_each(?)) ORDER BY id DESC",
        )
        .bind(serde_json::to_string(&names)?)
        .fetch_all(&self.readers)
        .await?)
    }

    /// Id of an unfinished job that has this input.
    pub(crate) async fn active_job_using(&self, id: &str) -> Result<Option<String>, StoreError> {
        Ok(sqlx::query_scalar(
            "SELECT id FROM jobs WHERE status IN ('queued', 'running', 'paused', 'cancelling')
             AND EXISTS (
                 SELECT 1 FROM json_each(CASE WHEN json_valid(record) THEN record END, '$.inputs')
                 WHERE value = ?
             ) LIMIT 1",
        )
        .bind(id)
        .fetch_optional(&self.readers)
        .await?)
    }

    /// Kind, status and number of jobs.
    pub(crate) async fn counts(&self) -> Result<Vec<(String, String, i64)>, StoreError> {
        Ok(sqlx::query_as("SELECT kind, status, count(*) FROM jobs GROUP BY kind, status")
            .fetch_all(&self.readers)
            .await?)
    }

    /// Grants a new worker the lease of a job until a Unix time (ms). `token_hash`: hash of the worker's
    /// token.
    pub(crate) async fn grant_lease(
        &self,
        id: &str,
        token_hash: &[u8],
        until: i64,
    ) -> Result<(), StoreError> {
        sqlx::query("UPDATE jobs SET token_hash = ?, lease_until = ? WHERE id = ?")
            .bind(token_hash)
            .bind(until)
            .bind(id)
            .execute(&self.writer)
            .await?;
        Ok(())
    }

    /// Extends all leases to a Unix time (ms). Longer leases are kept, but limited to `max` in case the clock
    /// was set back.
    pub(crate) async fn extend_leases(&self, until: i64, max: i64) -> Result<(), StoreError> {
        let text = "UPDATE jobs SET lease_until = min(max(lease_until, ?), ?)
             WHERE status IN ('running', 'cancelling')";
        sqlx::query(text).bind(until).bind(max).execute(&self.writer).await?;
        Ok(())
    }

    /// Renews the lease of the current worker; `false` if the token belongs to another worker.
    pub(crate) async fn renew_lease(
        &self,
        id: &str,
        token_hash: &[u8],
        until: i64,
    ) -> Result<bool, StoreError> {
        let result = sqlx::query(
            "UPDATE jobs SET lease_until = ?
             WHERE id = ? AND token_hash = ? AND status IN ('running', 'cancelling')",
        )
        .bind(until)
        .bind(id)
        .bind(token_hash)
        .execute(&self.writer)
        .await?;
        Ok(result.rows_affected() == 1)
    }

    /// Whether a token belongs to the current worker of a job.
    pub(crate) async fn is_current_token(
        &self,
        id: &str,
        token_hash: &[u8],
    ) -> Result<bool, StoreError> {
        let row: Option<i64> = sqlx::query_scalar(
            "SELECT 1 FROM jobs
             WHERE id = ? AND token_hash = ? AND status IN ('running', 'cancelling')",
        )
        .bind(id)
        .bind(token_hash)
        .fetch_optional(&self.readers)
        .await?;
        Ok(row.is_some())
    }

    /// Ids of the jobs whose lease has expired.
    pub(crate) async fn expired_leases(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar(
            "SELECT id FROM jobs WHERE status IN ('running', 'cancelling') AND lease_until < ?",
        )
        .bind(now())
        .fetch_all(&self.readers)
        .await?)
    }

    /// Deletes a job, its events and its file names.
    pub(crate) async fn delete_job(&self, id: &str) -> Result<(), StoreError> {
        let mut transaction = self.begin_transaction().await?;
        for text in [
            "DELETE FROM events WHERE job = ?",
            "DELETE FROM metric_chunks WHERE job = ?",
            "DELETE FROM job_metadata WHERE job = ?",
            "DELETE FROM artifact_names WHERE owner = ?",
            "DELETE FROM jobs WHERE id = ?",
        ] {
            sqlx::query(text).bind(id).execute(&mut *transaction).await?;
        }
        transaction.commit().await?;
        Ok(())
    }
}
