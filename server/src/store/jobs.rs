//! Jobs in the store.

use super::events::{self, News, Type};
use super::{Store, StoreError};
use crate::job::{Job, Kind, Status};
use chrono::Utc;
use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, Row, Sqlite, Transaction};

/// Which jobs to list.
#[derive(Clone, Debug, Default)]
pub(crate) struct Filter {
    /// In one of these states; any if there is none.
    pub(crate) status: Vec<Status>,
    /// Of one of these kinds; any if there is none.
    pub(crate) kind: Vec<Kind>,
    /// With these metadata.
    pub(crate) metadata: Vec<(String, String)>,
    /// After this id.
    pub(crate) after: Option<String>,
    /// Oldest first.
    pub(crate) oldest_first: bool,
    /// At most so many.
    pub(crate) limit: i64,
}

/// What became of asking for a job under a key.
#[derive(Debug)]
pub(crate) enum Created {
    /// It is new.
    New(Job),
    /// It was asked for before, in the same words.
    Before(Job),
    /// The key was used for something else.
    Other,
    /// The key was used for a job that is no longer there.
    Gone,
}

/// How long the answer to a key is remembered (ms).
const REMEMBERED: i64 = 24 * 3600 * 1000;

fn now() -> i64 {
    Utc::now().timestamp_millis()
}

async fn write(change: &mut Transaction<'static, Sqlite>, job: &Job) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO jobs (id, kind, status, priority, lease_until, record) VALUES (?, ?, ?, ?, 0, ?)
         ON CONFLICT (id) DO UPDATE
         SET status = excluded.status, priority = excluded.priority, record = excluded.record",
    )
    .bind(&job.id)
    .bind(job.kind.name())
    .bind(job.status.name())
    .bind(job.priority)
    .bind(serde_json::to_string(job)?)
    .execute(&mut **change)
    .await?;
    Ok(())
}

async fn read(
    change: &mut Transaction<'static, Sqlite>,
    id: &str,
) -> Result<Option<Job>, StoreError> {
    let record: Option<String> = sqlx::query_scalar("SELECT record FROM jobs WHERE id = ?")
        .bind(id)
        .fetch_optional(&mut **change)
        .await?;
    Ok(record.map(|record| serde_json::from_str(&record)).transpose()?)
}

/// What became of a key before.
async fn asked(
    change: &mut Transaction<'static, Sqlite>,
    key: &str,
    body: &str,
) -> Result<Option<Created>, StoreError> {
    let before = sqlx::query("SELECT body, job FROM answers WHERE key = ? AND created_at >= ?")
        .bind(key)
        .bind(now() - REMEMBERED)
        .fetch_optional(&mut **change)
        .await?;
    let Some(before) = before else { return Ok(None) };
    if before.try_get::<String, _>("body")? != body {
        return Ok(Some(Created::Other));
    }
    let id: String = before.try_get("job")?;
    Ok(Some(read(change, &id).await?.map_or(Created::Gone, Created::Before)))
}

/// What others see of a job's record: the number of a report concerns nobody but the one who reports.
fn seen(mut record: Value) -> Value {
    record.as_object_mut().map(|fields| fields.remove("heard"));
    record
}

impl Store {
    /// What became of a key, with the hash of what was asked under it, if it was used before.
    pub(crate) async fn asked(
        &self,
        key: Option<(&str, &str)>,
    ) -> Result<Option<Created>, StoreError> {
        let Some((key, body)) = key else { return Ok(None) };
        asked(&mut self.begin().await?, key, body).await
    }

    /// Adds a job, once for each key.
    pub(crate) async fn create(
        &self,
        job: &Job,
        key: Option<(&str, &str)>,
    ) -> Result<Created, StoreError> {
        let mut change = self.begin().await?;
        if let Some((key, body)) = key {
            sqlx::query("DELETE FROM answers WHERE created_at < ?")
                .bind(now() - REMEMBERED)
                .execute(&mut *change)
                .await?;
            if let Some(before) = asked(&mut change, key, body).await? {
                return Ok(before);
            }
            sqlx::query("INSERT INTO answers (key, body, job, created_at) VALUES (?, ?, ?, ?)")
                .bind(key)
                .bind(body)
                .bind(&job.id)
                .bind(now())
                .execute(&mut *change)
                .await?;
        }
        write(&mut change, job).await?;
        let news = News::new(Type::Status, "queued", json!({ "status": job.status }));
        let last = events::append(&mut change, &job.id, &[news]).await?;
        change.commit().await?;
        self.tell(last);
        Ok(Created::New(job.clone()))
    }

    /// One job.
    pub(crate) async fn job(&self, id: &str) -> Result<Option<Job>, StoreError> {
        let record: Option<String> = sqlx::query_scalar("SELECT record FROM jobs WHERE id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        Ok(record.map(|record| serde_json::from_str(&record)).transpose()?)
    }

    /// Jobs, newest first unless asked otherwise.
    pub(crate) async fn jobs(&self, filter: &Filter) -> Result<Vec<Job>, StoreError> {
        let marks = |count: usize| vec!["?"; count].join(", ");
        let mut conditions = vec!["1 = 1".to_owned()];
        if !filter.status.is_empty() {
            conditions.push(format!("status IN ({})", marks(filter.status.len())));
        }
        if !filter.kind.is_empty() {
            conditions.push(format!("kind IN ({})", marks(filter.kind.len())));
        }
        for _ in &filter.metadata {
            conditions.push(
                "EXISTS (SELECT 1 FROM json_each(record, '$.metadata') WHERE key = ? AND value = ?)"
                    .into(),
            );
        }
        let (sign, order) = if filter.oldest_first { (">", "ASC") } else { ("<", "DESC") };
        if filter.after.is_some() {
            conditions.push(format!("id {sign} ?"));
        }
        // Nothing of the caller's is in the text.
        let text = AssertSqlSafe(format!(
            "SELECT record FROM jobs WHERE {} ORDER BY id {order} LIMIT ?",
            conditions.join(" AND ")
        ));
        let mut query = sqlx::query_scalar::<_, String>(text);
        for status in &filter.status {
            query = query.bind(status.name());
        }
        for kind in &filter.kind {
            query = query.bind(kind.name());
        }
        for (key, value) in &filter.metadata {
            query = query.bind(key).bind(value);
        }
        if let Some(after) = &filter.after {
            query = query.bind(after);
        }
        let records = query.bind(filter.limit).fetch_all(&self.readers).await?;
        Ok(records.iter().map(|record| serde_json::from_str(record)).collect::<Result<_, _>>()?)
    }

    /// Changes a job, and writes down what happened; `None` if there is none. A refusal changes nothing.
    pub(crate) async fn change<T, E>(
        &self,
        id: &str,
        change: impl FnOnce(&mut Job, &mut Vec<News>) -> Result<T, E>,
    ) -> Result<Option<Result<(Job, T), E>>, StoreError> {
        let mut transaction = self.begin().await?;
        let Some(mut job) = read(&mut transaction, id).await? else { return Ok(None) };
        let mut news = Vec::new();
        let before = serde_json::to_value(&job)?;
        let told = match change(&mut job, &mut news) {
            Ok(told) => told,
            Err(refusal) => return Ok(Some(Err(refusal))),
        };
        let after = serde_json::to_value(&job)?;
        let is_seen = seen(after.clone()) != seen(before.clone());
        if is_seen {
            job.revision += 1;
            job.updated_at = Utc::now();
        }
        if after != before {
            write(&mut transaction, &job).await?;
        }
        let last = events::append(&mut transaction, id, &news).await?;
        transaction.commit().await?;
        match last {
            Some(_) => self.tell(last),
            // No event, and yet somebody may wait for it.
            None if is_seen => self.last.send_modify(|_| {}),
            None => {}
        }
        Ok(Some(Ok((job, told))))
    }

    /// The job that comes next, if one waits.
    pub(crate) async fn next_queued(&self) -> Result<Option<String>, StoreError> {
        Ok(sqlx::query_scalar(
            "SELECT id FROM jobs WHERE status = 'queued' ORDER BY priority DESC, id LIMIT 1",
        )
        .fetch_optional(&self.readers)
        .await?)
    }

    /// Ids of the jobs in one of these states, the newest first.
    pub(crate) async fn ids_in(&self, status: &[Status]) -> Result<Vec<String>, StoreError> {
        let names: Vec<&str> = status.iter().map(|status| status.name()).collect();
        Ok(sqlx::query_scalar(
            "SELECT id FROM jobs WHERE status IN (SELECT value FROM json_each(?)) ORDER BY id DESC",
        )
        .bind(serde_json::to_string(&names)?)
        .fetch_all(&self.readers)
        .await?)
    }

    /// A job that has not ended and works on what has this id, if there is one.
    pub(crate) async fn user_of(&self, id: &str) -> Result<Option<String>, StoreError> {
        Ok(sqlx::query_scalar(
            "SELECT id FROM jobs WHERE status IN ('queued', 'running', 'paused', 'cancelling')
             AND EXISTS (SELECT 1 FROM json_each(record, '$.inputs') WHERE value = ?) LIMIT 1",
        )
        .bind(id)
        .fetch_optional(&self.readers)
        .await?)
    }

    /// How many jobs there are of each kind in each state.
    pub(crate) async fn counts(&self) -> Result<Vec<(String, String, i64)>, StoreError> {
        Ok(sqlx::query_as("SELECT kind, status, count(*) FROM jobs GROUP BY kind, status")
            .fetch_all(&self.readers)
            .await?)
    }

    /// Lets a process work on a job until a time (ms); `token` is the hash of what it proves itself with.
    pub(crate) async fn lease(&self, id: &str, token: &[u8], until: i64) -> Result<(), StoreError> {
        sqlx::query("UPDATE jobs SET token = ?, lease_until = ? WHERE id = ?")
            .bind(token)
            .bind(until)
            .bind(id)
            .execute(&self.writer)
            .await?;
        Ok(())
    }

    /// Lets all processes go on until a time (ms), or as long as they may already, but to no later time than `most`: the
    /// clock may have been set back.
    pub(crate) async fn lease_all(&self, until: i64, most: i64) -> Result<(), StoreError> {
        let text = "UPDATE jobs SET lease_until = min(max(lease_until, ?), ?)
             WHERE status IN ('running', 'cancelling')";
        sqlx::query(text).bind(until).bind(most).execute(&self.writer).await?;
        Ok(())
    }

    /// Lets it go on; `false` if it is no longer its turn.
    pub(crate) async fn renew(
        &self,
        id: &str,
        token: &[u8],
        until: i64,
    ) -> Result<bool, StoreError> {
        let done = sqlx::query(
            "UPDATE jobs SET lease_until = ?
             WHERE id = ? AND token = ? AND status IN ('running', 'cancelling')",
        )
        .bind(until)
        .bind(id)
        .bind(token)
        .execute(&self.writer)
        .await?;
        Ok(done.rows_affected() == 1)
    }

    /// Whether it is the turn of whoever has a token.
    pub(crate) async fn is_its_turn(&self, id: &str, token: &[u8]) -> Result<bool, StoreError> {
        let found: Option<i64> = sqlx::query_scalar(
            "SELECT 1 FROM jobs WHERE id = ? AND token = ? AND status IN ('running', 'cancelling')",
        )
        .bind(id)
        .bind(token)
        .fetch_optional(&self.readers)
        .await?;
        Ok(found.is_some())
    }

    /// Jobs whose process has not been heard of for too long.
    pub(crate) async fn expired(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar(
            "SELECT id FROM jobs WHERE status IN ('running', 'cancelling') AND lease_until < ?",
        )
        .bind(now())
        .fetch_all(&self.readers)
        .await?)
    }

    /// Forgets a job and what happened to it.
    pub(crate) async fn delete(&self, id: &str) -> Result<(), StoreError> {
        let mut change = self.begin().await?;
        for text in [
            "DELETE FROM events WHERE job = ?",
            "DELETE FROM job_artifacts WHERE job = ?",
            "DELETE FROM jobs WHERE id = ?",
        ] {
            sqlx::query(text).bind(id).execute(&mut *change).await?;
        }
        change.commit().await?;
        Ok(())
    }
}
