//! What happened to jobs, in one order for all of them.

use super::{Store, StoreError};
use chrono::{SecondsFormat, Utc};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, Row, Sqlite, Transaction};
use tokio::sync::watch;
use utoipa::ToSchema;

/// How important.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Level {
    /// As it should be.
    Info,
    /// Somebody should know.
    Warn,
    /// Something ended.
    Error,
}

/// What kind of thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Type {
    /// The job stands elsewhere.
    Status,
    /// It is further.
    Progress,
    /// It measured something.
    Metric,
    /// It said something.
    Log,
    /// It wrote a model on its way.
    Checkpoint,
    /// It made something.
    Artifact,
    /// Somebody should look.
    Alert,
}

impl Level {
    fn name(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warn => "warn",
            Self::Error => "error",
        }
    }
}

impl Type {
    /// All of them.
    pub(crate) const ALL: [Self; 7] = [
        Self::Status,
        Self::Progress,
        Self::Metric,
        Self::Log,
        Self::Checkpoint,
        Self::Artifact,
        Self::Alert,
    ];

    /// The one that is called so.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// As in JSON.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Status => "status",
            Self::Progress => "progress",
            Self::Metric => "metric",
            Self::Log => "log",
            Self::Checkpoint => "checkpoint",
            Self::Artifact => "artifact",
            Self::Alert => "alert",
        }
    }
}

/// Something that is about to be written down.
#[derive(Clone, Debug)]
pub(crate) struct News {
    /// How important.
    pub(crate) level: Level,
    /// What kind of thing.
    pub(crate) kind: Type,
    /// For people.
    pub(crate) message: String,
    /// For programs.
    pub(crate) data: Value,
}

impl News {
    /// Something as it should be.
    pub(crate) fn new(kind: Type, message: impl Into<String>, data: Value) -> Self {
        Self { level: Level::Info, kind, message: message.into(), data }
    }
}

/// Something that was written down.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Event {
    /// Its place among the events of all jobs.
    pub(crate) seq: i64,
    /// The kind of thing.
    pub(crate) kind: String,
    /// All of it.
    pub(crate) json: Value,
}

impl Event {
    fn of(row: &SqliteRow) -> Result<Self, StoreError> {
        let seq: i64 = row.try_get("seq")?;
        let kind: String = row.try_get("type")?;
        let data: Value = serde_json::from_str(row.try_get("data")?)?;
        let text = |name| row.try_get::<String, _>(name);
        let json = json!({
            "id": format!("evt_{seq}"), "seq": seq, "job": text("job")?, "created_at": text("created_at")?,
            "level": text("level")?, "type": kind, "message": text("message")?, "data": data,
        });
        Ok(Self { seq, kind, json })
    }
}

/// Writes events down; gives the number of the last one.
pub(super) async fn append(
    change: &mut Transaction<'static, Sqlite>,
    job: &str,
    news: &[News],
) -> Result<Option<i64>, StoreError> {
    let mut last = None;
    for news in news {
        let done = sqlx::query(
            "INSERT INTO events (job, created_at, level, type, message, data) VALUES (?, ?, ?, ?, ?, ?)",
        )
        .bind(job)
        .bind(Utc::now().to_rfc3339_opts(SecondsFormat::Millis, true))
        .bind(news.level.name())
        .bind(news.kind.name())
        .bind(&news.message)
        .bind(news.data.to_string())
        .execute(&mut **change)
        .await?;
        last = Some(done.last_insert_rowid());
    }
    Ok(last)
}

impl Store {
    /// Events of these jobs, or of all if none is named, after a number, oldest first.
    pub(crate) async fn events(
        &self,
        jobs: &[String],
        kind: Option<Type>,
        after: i64,
        limit: i64,
    ) -> Result<Vec<Event>, StoreError> {
        let marks = vec!["?"; jobs.len()].join(", ");
        let of_jobs = if jobs.is_empty() { String::new() } else { format!("job IN ({marks}) AND") };
        let of_kind = if kind.is_some() { "AND type = ?" } else { "" };
        // Nothing of the caller's is in the text.
        let text = AssertSqlSafe(format!(
            "SELECT * FROM events WHERE {of_jobs} seq > ? {of_kind} ORDER BY seq LIMIT ?"
        ));
        let mut query = sqlx::query(text);
        for job in jobs {
            query = query.bind(job);
        }
        query = query.bind(after);
        if let Some(kind) = kind {
            query = query.bind(kind.name());
        }
        let rows = query.bind(limit).fetch_all(&self.readers).await?;
        rows.iter().map(Event::of).collect()
    }

    /// Changes whenever something is written down.
    pub(crate) fn news(&self) -> watch::Receiver<i64> {
        self.last.subscribe()
    }

    /// Tells that something was written down.
    pub(super) fn tell(&self, last: Option<i64>) {
        if let Some(last) = last {
            self.last.send_if_modified(|known| {
                let is_new = last > *known;
                *known = last.max(*known);
                is_new
            });
        }
    }
}
