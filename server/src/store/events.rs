//! Event log: one totally ordered sequence for all jobs.

use super::{Store, StoreError};
use chrono::{SecondsFormat, Utc};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, Row, Sqlite, Transaction};
use tokio::sync::watch;
use utoipa::ToSchema;

/// Severity of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Level {
    /// Normal operation.
    Info,
    /// Needs attention.
    Warn,
    /// The job failed.
    Error,
}

/// Type of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum EventType {
    /// The status changed.
    Status,
    /// The progress changed.
    Progress,
    /// The worker reported metrics.
    Metric,
    /// The worker logged a message.
    Log,
    /// A checkpoint was stored.
    Checkpoint,
    /// An output file was stored.
    Artifact,
    /// A problem that needs attention.
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

impl EventType {
    /// All types, in the order of the documentation.
    pub(crate) const ALL: [Self; 7] = [
        Self::Status,
        Self::Progress,
        Self::Metric,
        Self::Log,
        Self::Checkpoint,
        Self::Artifact,
        Self::Alert,
    ];

    /// Inverse of [`EventType::name`].
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Name in JSON and in the database.
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

/// Event that is not in the log yet.
#[derive(Clone, Debug)]
pub(crate) struct NewEvent {
    /// Severity.
    pub(crate) level: Level,
    /// Type.
    pub(crate) kind: EventType,
    /// Text for users.
    pub(crate) message: String,
    /// Machine-readable details.
    pub(crate) data: Value,
}

impl NewEvent {
    /// Event at level `info`.
    pub(crate) fn new(kind: EventType, message: impl Into<String>, data: Value) -> Self {
        Self { level: Level::Info, kind, message: message.into(), data }
    }
}

/// Event in the log.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Event {
    /// Sequence number among the events of all jobs.
    pub(crate) seq: i64,
    /// Name of the type.
    pub(crate) kind: String,
    /// The event as clients receive it.
    pub(crate) json: Value,
}

impl Event {
    fn from_row(row: &SqliteRow) -> Result<Self, StoreError> {
        let seq: i64 = row.try_get("seq")?;
        let kind: String = row.try_get("type")?;
        // A damaged event keeps its place in the order.
        let data: Value = serde_json::from_str(row.try_get("data")?).unwrap_or_default();
        let text = |name| row.try_get::<String, _>(name);
        let json = json!({
            "id": format!("evt_{seq}"), "seq": seq, "job": text("job")?, "created_at": text("created_at")?,
            "level": text("level")?, "type": kind, "message": text("message")?, "data": data,
        });
        Ok(Self { seq, kind, json })
    }
}

/// Appends events to the log; returns the sequence number of the last one.
pub(super) async fn append(
    transaction: &mut Transaction<'static, Sqlite>,
    job: &str,
    events: &[NewEvent],
) -> Result<Option<i64>, StoreError> {
    let mut last = None;
    for event in events {
        let done = sqlx::query(
            "INSERT INTO events (job, created_at, level, type, message, data) VALUES (?, ?, ?, ?, ?, ?)",
        )
        .bind(job)
        .bind(Utc::now().to_rfc3339_opts(SecondsFormat::Millis, true))
        .bind(event.level.name())
        .bind(event.kind.name())
        .bind(&event.message)
        .bind(event.data.to_string())
        .execute(&mut **transaction)
        .await?;
        last = Some(done.last_insert_rowid());
    }
    Ok(last)
}

impl Store {
    /// Events of these jobs (empty: of all jobs) after a sequence number, oldest first.
    pub(crate) async fn events(
        &self,
        jobs: &[String],
        kind: Option<EventType>,
        after: i64,
        limit: i64,
    ) -> Result<Vec<Event>, StoreError> {
        let placeholders = vec!["?"; jobs.len()].join(", ");
        let of_jobs =
            if jobs.is_empty() { String::new() } else { format!("job IN ({placeholders}) AND") };
        let of_kind = if kind.is_some() { "AND type = ?" } else { "" };
        // The text contains no caller input; all values are bound.
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
        rows.iter().map(Event::from_row).collect()
    }

    /// Receiver of the sequence number of the last event; notified after every commit visible to clients.
    pub(crate) fn subscribe(&self) -> watch::Receiver<i64> {
        self.last_event.subscribe()
    }

    /// Notifies subscribers of events up to `last`.
    pub(super) fn notify(&self, last: Option<i64>) {
        if let Some(last) = last {
            self.last_event.send_if_modified(|known| {
                let is_new = last > *known;
                *known = last.max(*known);
                is_new
            });
        }
    }
}
