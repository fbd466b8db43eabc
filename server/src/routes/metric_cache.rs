//! Cache of metric tables: the page requests the metrics of a running job every few seconds.

use super::metric_table::{MetricTable, Selection};
use crate::jobs::Job;
use crate::store::{MIN_CHUNK_EVENTS, Store, StoreError};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of cached tables.
const MAX_TABLES: usize = 8;

/// Maximum number of values of all cached tables (8 bytes each).
const MAX_VALUES: usize = 8_000_000;

/// Maximum number of cached selections per table.
const MAX_SELECTIONS: usize = 4;

/// Metrics of a job up to an event, and the rows of recent selections.
#[derive(Debug, Default)]
pub(super) struct CachedTable {
    pub(super) table: MetricTable,
    /// Sequence number of the last event in the table.
    last_seq: i64,
    selections: Vec<(Selection, Arc<[usize]>)>,
}

/// Cached tables by job id, most recently used last.
#[derive(Debug, Default)]
pub(crate) struct MetricCache(Mutex<Vec<(String, SharedTable)>>);

/// Table of one job; locked while it is read or extended.
pub(super) type SharedTable = Arc<tokio::sync::Mutex<CachedTable>>;

impl MetricCache {
    /// Table of a job, empty if it is not cached.
    pub(super) fn table(&self, job: &str) -> SharedTable {
        let mut tables = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = tables.iter().position(|(id, _)| id == job);
        let entry = known.map_or_else(
            || (job.to_owned(), SharedTable::default()),
            |position| tables.remove(position),
        );
        let table = entry.1.clone();
        tables.push(entry);
        // Tables in use by a request are counted at the next one.
        let (mut count, mut values) = (0, 0);
        tables.reverse();
        tables.retain(|(id, table)| {
            values += table.try_lock().map_or(0, |table| table.table.len());
            count += 1;
            id == job || (values <= MAX_VALUES && count <= MAX_TABLES)
        });
        tables.reverse();
        table
    }
}

impl CachedTable {
    /// Adds the events since the last request. Returns whether many of them have no stored chunk: those of versions
    /// without chunks.
    pub(super) async fn update(&mut self, store: &Store, job: &Job) -> Result<bool, StoreError> {
        let started = job.started_at.unwrap_or(job.created_at);
        let mut unstored = 0;
        loop {
            let chunks = store.metrics(&job.id, self.last_seq).await?;
            let Some(newest) = chunks.last() else { return Ok(unstored >= MIN_CHUNK_EVENTS) };
            self.last_seq = newest.last_seq;
            self.selections.clear();
            for chunk in &chunks {
                self.table.add(chunk, started);
                unstored += if chunk.is_stored { 0 } else { chunk.steps.len() as i64 };
            }
        }
    }

    /// Rows of a selection.
    pub(super) fn rows(&mut self, selection: &Selection) -> Arc<[usize]> {
        if let Some((_, rows)) = self.selections.iter().find(|(known, _)| known == selection) {
            return rows.clone();
        }
        let rows: Arc<[usize]> = self.table.downsample_min_max(selection).into();
        if self.selections.len() == MAX_SELECTIONS {
            self.selections.remove(0);
        }
        self.selections.push((selection.clone(), rows.clone()));
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_recently_used_table_is_dropped() {
        let cache = MetricCache::default();
        let first = cache.table("job_0");
        for number in 1..MAX_TABLES {
            cache.table(&format!("job_{number}"));
        }
        assert!(Arc::ptr_eq(&first, &cache.table("job_0")));
        let second = cache.table("job_1");
        for number in 10..10 + MAX_TABLES {
            cache.table(&format!("job_{number}"));
        }
        assert!(!Arc::ptr_eq(&second, &cache.table("job_1")));
    }
}
