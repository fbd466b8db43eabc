//! Metrics of a job as columns, in chunks of consecutive events.
//!
//! Metric events are copied into chunks of binary columns while they are appended. A job with 200,000 metric
//! events is then read in milliseconds; parsing its events takes seconds.

use super::{Store, StoreError};
use chrono::{DateTime, Utc};
use serde_json::{Map, Value};
use sqlx::{Sqlite, Transaction};

/// Number of events without a chunk from which they are copied into one.
pub(crate) const MIN_CHUNK_EVENTS: i64 = 1024;

/// Maximum number of events of a chunk.
const MAX_CHUNK_EVENTS: i64 = 4096;

/// Number of chunks read at a time.
const CHUNKS_PER_READ: i64 = 16;

/// Maximum number of chunks written by one transaction. Limits its duration for jobs of versions without
/// chunks.
const MAX_CHUNKS: usize = 4;

/// Metrics of consecutive events of a job. All columns have one value per row; NaN: not measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MetricChunk {
    /// Sequence number of the last event.
    pub(crate) last_seq: i64,
    /// Whether the chunk is stored, not only its events.
    pub(crate) is_stored: bool,
    /// Training step of each row.
    pub(crate) steps: Vec<u64>,
    /// Time of each event (Unix, ms).
    pub(crate) times_ms: Vec<i64>,
    /// Name and values of each metric, in order of first appearance.
    pub(crate) columns: Vec<(String, Vec<f64>)>,
}

impl MetricChunk {
    /// Adds the metrics of an event; an event without a step has no row.
    fn push(&mut self, seq: i64, time: &str, mut values: Map<String, Value>) {
        self.last_seq = seq;
        let Some(step) = values.remove("step").and_then(|step| step.as_u64()) else { return };
        let row = self.steps.len();
        self.steps.push(step);
        let time: Option<DateTime<Utc>> = time.parse().ok();
        self.times_ms.push(time.unwrap_or_default().timestamp_millis());
        for (name, value) in values {
            let known = self.columns.iter().position(|(known, _)| *known == name);
            let column = known.unwrap_or_else(|| {
                self.columns.push((name, Vec::new()));
                self.columns.len() - 1
            });
            let column = &mut self.columns[column].1;
            column.resize(row, f64::NAN);
            column.push(value.as_f64().unwrap_or(f64::NAN));
        }
    }

    /// Completes all columns.
    fn finish(mut self) -> Self {
        for (_, values) in &mut self.columns {
            values.resize(self.steps.len(), f64::NAN);
        }
        self
    }

    /// Binary form: the length of the JSON array of names (u32), the array, then steps, times and columns, each
    /// with 8 bytes per row. All numbers are little-endian.
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        let names: Vec<&str> = self.columns.iter().map(|(name, _)| name.as_str()).collect();
        let names = serde_json::to_vec(&names)?;
        let mut content = (names.len() as u32).to_le_bytes().to_vec();
        content.extend(names);
        content.extend(self.steps.iter().flat_map(|step| step.to_le_bytes()));
        content.extend(self.times_ms.iter().flat_map(|time| time.to_le_bytes()));
        for (_, values) in &self.columns {
            content.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        Ok(content)
    }

    /// Inverse of [`MetricChunk::encode`]; `None` if the content is damaged.
    fn decode(last_seq: i64, content: &[u8]) -> Option<Self> {
        let (length, rest) = content.split_first_chunk::<4>()?;
        let (names, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        let names: Vec<String> = serde_json::from_slice(names).ok()?;
        let (numbers, remainder) = rest.as_chunks::<8>();
        let columns = names.len() + 2;
        if !remainder.is_empty() || numbers.len() % columns != 0 {
            return None;
        }
        let rows = numbers.len() / columns;
        let mut parts = (0..columns).map(|column| &numbers[column * rows..(column + 1) * rows]);
        Some(Self {
            last_seq,
            is_stored: true,
            steps: parts.next()?.iter().map(|bytes| u64::from_le_bytes(*bytes)).collect(),
            times_ms: parts.next()?.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect(),
            columns: names
                .into_iter()
                .zip(parts)
                .map(|(name, part)| {
                    (name, part.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
                })
                .collect(),
        })
    }
}

/// Query for the metric events of a job after a sequence number; placeholders: job, sequence number, number of
/// events.
const EVENTS: &str = "SELECT seq, created_at, data FROM events
     WHERE job = ? AND type = 'metric' AND seq > ? ORDER BY seq LIMIT ?";

/// Row of [`EVENTS`]: sequence number, time, metrics as JSON.
type MetricEvent = (i64, String, String);

/// Chunk of these events; unreadable ones have no row.
fn chunk_of(events: &[MetricEvent]) -> MetricChunk {
    let mut chunk = MetricChunk::default();
    for (seq, time, data) in events {
        chunk.push(*seq, time, serde_json::from_str(data).unwrap_or_default());
    }
    chunk.finish()
}

/// Copies the metric events of a job that have no chunk yet into chunks, if they are numerous. Returns whether
/// more may remain.
pub(super) async fn copy_events(
    transaction: &mut Transaction<'static, Sqlite>,
    job: &str,
) -> Result<bool, StoreError> {
    for _ in 0..MAX_CHUNKS {
        let last: i64 = sqlx::query_scalar(
            "SELECT coalesce(max(last_seq), 0) FROM metric_chunks WHERE job = ?",
        )
        .bind(job)
        .fetch_one(&mut **transaction)
        .await?;
        let count: i64 = sqlx::query_scalar(
            "SELECT count(*) FROM (
                 SELECT 1 FROM events WHERE job = ? AND type = 'metric' AND seq > ? LIMIT ?
             )",
        )
        .bind(job)
        .bind(last)
        .bind(MIN_CHUNK_EVENTS)
        .fetch_one(&mut **transaction)
        .await?;
        if count < MIN_CHUNK_EVENTS {
            return Ok(false);
        }
        let events: Vec<MetricEvent> = sqlx::query_as(EVENTS)
            .bind(job)
            .bind(last)
            .bind(MAX_CHUNK_EVENTS)
            .fetch_all(&mut **transaction)
            .await?;
        let chunk = chunk_of(&events);
        sqlx::query("INSERT INTO metric_chunks (job, last_seq, content) VALUES (?, ?, ?)")
            .bind(job)
            .bind(chunk.last_seq)
            .bind(chunk.encode()?)
            .execute(&mut **transaction)
            .await?;
    }
    Ok(true)
}

impl Store {
    /// Metrics of a job after the event `after`, in the order of the events: some stored chunks, or one chunk of
    /// events that have none; empty at the end.
    pub(crate) async fn metrics(
        &self,
        job: &str,
        after: i64,
    ) -> Result<Vec<MetricChunk>, StoreError> {
        let stored: Vec<(i64, Vec<u8>)> = sqlx::query_as(
            "SELECT last_seq, content FROM metric_chunks WHERE job = ? AND last_seq > ?
             ORDER BY last_seq LIMIT ?",
        )
        .bind(job)
        .bind(after)
        .bind(CHUNKS_PER_READ)
        .fetch_all(&self.readers)
        .await?;
        let decode = |(last_seq, content): &(i64, Vec<u8>)| {
            let chunk = MetricChunk::decode(*last_seq, content);
            if chunk.is_none() {
                // The events are complete.
                tracing::error!(job, last_seq, "damaged chunk of metrics");
            }
            chunk
        };
        let chunks: Vec<_> = stored.iter().map_while(decode).collect();
        if !chunks.is_empty() {
            return Ok(chunks);
        }
        let events: Vec<MetricEvent> = sqlx::query_as(EVENTS)
            .bind(job)
            .bind(after)
            .bind(MAX_CHUNK_EVENTS)
            .fetch_all(&self.readers)
            .await?;
        Ok(if events.is_empty() { Vec::new() } else { vec![chunk_of(&events)] })
    }

    /// Copies the metric events of a job into chunks: those of versions without chunks.
    pub(crate) async fn copy_metrics(&self, job: &str) -> Result<(), StoreError> {
        loop {
            let mut transaction = self.begin_transaction().await?;
            let may_remain = copy_events(&mut transaction, job).await?;
            transaction.commit().await?;
            if !may_remain {
                return Ok(());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn chunk() -> MetricChunk {
        let event =
            |seq, data: Value| (seq, "1970-01-01T00:00:01.500Z".to_owned(), data.to_string());
        chunk_of(&[
            event(7, json!({ "step": 10, "loss": 0.5 })),
            event(8, json!({ "loss": 3.0 })),
            event(9, json!({ "step": 20, "rate": 2, "note": "x" })),
        ])
    }

    #[test]
    fn chunk_has_one_row_per_event_with_a_step() {
        let chunk = chunk();
        assert_eq!((chunk.last_seq, &chunk.steps), (9, &vec![10, 20]));
        assert_eq!(chunk.times_ms, [1500, 1500]);
        let column = |name: &str| &chunk.columns.iter().find(|(known, _)| known == name).unwrap().1;
        assert!(column("loss")[0] == 0.5 && column("loss")[1].is_nan());
        assert!(column("rate")[0].is_nan() && column("rate")[1] == 2.0);
        assert!(column("note").iter().all(|value| value.is_nan()));
    }

    #[test]
    fn decoding_inverts_encoding_and_rejects_damaged_content() {
        let content = chunk().encode().unwrap();
        let decoded = MetricChunk::decode(9, &content).unwrap();
        let stored = MetricChunk { is_stored: true, ..chunk() };
        // NaN differs from itself.
        assert_eq!(format!("{decoded:?}"), format!("{stored:?}"));
        for length in 0..content.len() {
            if let Some(short) = MetricChunk::decode(9, &content[..length]) {
                assert!(short.steps.len() < 2, "{length}");
            }
        }
        assert_eq!(MetricChunk::decode(9, &[255; 8]), None);
    }
}
