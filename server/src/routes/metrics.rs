//! Metrics of a job as a table: JSON, CSV or NDJSON.

use super::jobs::find_job;
use super::{RequireScheduler, schemas};
use crate::Problem;
use crate::extract::{Path, Query};
use crate::jobs::Job;
use crate::jobs::scheduler::JobScheduler;
use crate::store::EventType;
use axum::Json;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use chrono::{DateTime, Utc};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Default number of returned rows.
const DEFAULT_POINTS: usize = 1000;

/// Maximum number of returned rows.
const MAX_POINTS: usize = 100_000;

/// Number of events read at a time.
const EVENTS_PER_READ: i64 = 4096;

/// Returns the metrics of a job as columns.
///
/// Long series are downsampled; minima and maxima are kept.
#[utoipa::path(
    get, path = "/jobs/{id}/metrics", tag = "events",
    params(("id" = String, Path, description = "Id of the job"), ("keys" = Option<String>, Query, description = "Metric names, separated by commas"), ("after_step" = Option<usize>, Query), ("max_points" = Option<usize>, Query), ("format" = Option<String>, Query, description = "json, csv or ndjson")),
    responses((
        status = 200, description = "Columns of numbers, downsampled",
        content((schemas::MetricColumns = "application/json"), (String = "text/csv"), (String = "application/x-ndjson")),
    )),
)]
pub(crate) async fn metrics(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Response, Problem> {
    let integer = |name: &str, default: usize| -> Result<usize, Problem> {
        let Some(text) = query.get(name) else { return Ok(default) };
        text.parse().map_err(|_| Problem::invalid_parameter(name, "must be a non-negative integer"))
    };
    let job = find_job(&scheduler, &id).await?;
    let (after, points) = (integer("after_step", 0)?, integer("max_points", DEFAULT_POINTS)?);
    let is_requested =
        |name: &str| query.get("keys").is_none_or(|keys| keys.split(',').any(|key| key == name));
    let table = load_table(&scheduler, &job, after as u64, is_requested).await?;
    let rows = table.downsample_min_max(points.min(MAX_POINTS));
    match query.get("format").map(String::as_str) {
        None | Some("json") => Ok(Json(table.columns(&rows)).into_response()),
        Some("ndjson") => {
            let text = table.ndjson(&rows);
            Ok(([(header::CONTENT_TYPE, "application/x-ndjson")], text).into_response())
        }
        Some("csv") => {
            let text = table.csv(&rows);
            Ok(([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], text).into_response())
        }
        Some(_) => Err(Problem::invalid_parameter("format", "must be json, csv or ndjson")),
    }
}

/// Loads the metrics of a job after a step; 0 loads all.
async fn load_table(
    scheduler: &JobScheduler,
    job: &Job,
    after: u64,
    is_requested: impl Fn(&str) -> bool,
) -> Result<MetricTable, Problem> {
    let started = job.started_at.unwrap_or(job.created_at);
    let (mut table, ids, mut last) = (MetricTable::default(), [job.id.clone()], 0);
    loop {
        let page =
            scheduler.store.events(&ids, Some(EventType::Metric), last, EVENTS_PER_READ).await?;
        let Some(newest) = page.last() else { break };
        last = newest.seq;
        for mut event in page {
            let at = event.json["created_at"].as_str().and_then(|at| at.parse().ok());
            let since = |at: DateTime<Utc>| (at - started).num_milliseconds() as f64 / 1e3;
            let Value::Object(mut values) = event.json["data"].take() else { continue };
            let Some(step) = values.remove("step").and_then(|step| step.as_u64()) else { continue };
            if step > after || after == 0 {
                values.retain(|name, _| is_requested(name));
                let row = table.row(step);
                for (name, value) in &values {
                    table.set(name, row, value.as_f64());
                }
                table.set(ELAPSED, row, at.map(since));
            }
        }
    }
    Ok(table)
}

/// Name of the column with the time since the job started (s).
const ELAPSED: &str = "elapsed_s";

/// Metrics by training step, in columns. A million rows with seven columns need 60 MB.
#[derive(Debug, Default)]
struct MetricTable {
    /// Training steps, ascending and unique.
    steps: Vec<u64>,
    /// Name and values of each metric, in order of first appearance. Values are indexed as the steps; NaN =
    /// not measured; trailing values may be missing.
    columns: Vec<(String, Vec<f64>)>,
}

impl MetricTable {
    /// Row of a step; inserted if new. A step repeated by a resumed worker reuses its row.
    fn row(&mut self, step: u64) -> usize {
        if self.steps.last().is_none_or(|last| *last < step) {
            self.steps.push(step);
            return self.steps.len() - 1;
        }
        self.steps.binary_search(&step).unwrap_or_else(|row| {
            self.steps.insert(row, step);
            for (_, values) in &mut self.columns {
                if row < values.len() {
                    values.insert(row, f64::NAN);
                }
            }
            row
        })
    }

    /// Sets a value; `None`, for a value that is not a number, is stored as NaN.
    fn set(&mut self, name: &str, row: usize, value: Option<f64>) {
        let known = self.columns.iter().position(|(known, _)| known == name);
        let column = known.unwrap_or_else(|| {
            self.columns.push((name.to_owned(), Vec::new()));
            self.columns.len() - 1
        });
        let values = &mut self.columns[column].1;
        if values.len() <= row {
            values.resize(row + 1, f64::NAN);
        }
        values[row] = value.unwrap_or(f64::NAN);
    }

    /// JSON of a value; integers without a decimal point, NaN as null.
    fn cell(values: &[f64], row: usize) -> Value {
        let value = values.get(row).copied().unwrap_or(f64::NAN);
        let is_integer = value.fract() == 0.0 && value.abs() < 1e15;
        if is_integer { json!(value as i64) } else { json!(value) }
    }

    /// JSON object with one array per column.
    fn columns(&self, rows: &[usize]) -> Map<String, Value> {
        let steps = rows.iter().map(|row| json!(self.steps[*row])).collect();
        let mut columns = Map::from_iter([("step".to_owned(), steps)]);
        for (name, values) in &self.columns {
            columns.insert(name.clone(), rows.iter().map(|row| Self::cell(values, *row)).collect());
        }
        columns
    }

    /// One JSON object per row, without missing values.
    fn ndjson(&self, rows: &[usize]) -> String {
        let line = |row: &usize| {
            let mut values = Map::from_iter([("step".to_owned(), json!(self.steps[*row]))]);
            let cells = self.columns.iter().map(|(name, of)| (name.clone(), Self::cell(of, *row)));
            values.extend(cells.filter(|(_, cell)| !cell.is_null()));
            format!("{}\n", Value::Object(values))
        };
        rows.iter().map(line).collect()
    }

    /// CSV with a header line; missing values are empty.
    fn csv(&self, rows: &[usize]) -> String {
        let names: Vec<&str> = self.columns.iter().map(|(name, _)| name.as_str()).collect();
        let mut text = format!("step,{}\n", names.join(","));
        for row in rows {
            let cells = self.columns.iter().map(|(_, of)| match Self::cell(of, *row) {
                Value::Null => String::new(),
                cell => cell.to_string(),
            });
            text += &format!("{},{}\n", self.steps[*row], cells.collect::<Vec<_>>().join(","));
        }
        text
    }

    /// Selects about `points` rows: the minimum and maximum of each column, except the time, in each of
    /// equally sized bins. Ascending.
    fn downsample_min_max(&self, points: usize) -> Vec<usize> {
        if self.steps.len() <= points.max(2) {
            return (0..self.steps.len()).collect();
        }
        let columns = || self.columns.iter().filter(|(name, _)| name != ELAPSED);
        let bins = (points / (2 * columns().count().max(1))).max(1);
        let mut rows = BTreeSet::new();
        for (_, values) in columns() {
            let known: Vec<usize> =
                (0..values.len()).filter(|row| !values[*row].is_nan()).collect();
            // Bins contain equal numbers of measured values, so sparse columns are covered.
            for bin in 0..bins {
                let [first, end] = [bin, bin + 1].map(|k| k * known.len() / bins);
                let order = |a: &&usize, b: &&usize| values[**a].total_cmp(&values[**b]);
                let binned = &known[first..end];
                rows.extend(binned.iter().min_by(order));
                rows.extend(binned.iter().max_by(order));
            }
        }
        rows.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(steps: impl IntoIterator<Item = (u64, f64)>) -> MetricTable {
        let mut table = MetricTable::default();
        for (step, loss) in steps {
            let row = table.row(step);
            table.set("loss", row, Some(loss));
        }
        table
    }

    #[test]
    fn downsampling_keeps_peaks_and_order() {
        let mut long = table((0..1000).map(|step| match step {
            617 => (step, 9.0),
            311 => (step, 0.1),
            _ => (step, 1.0),
        }));
        // A sparse column.
        for (step, value) in [(250, 1.0), (500, 7.0), (750, 2.0)] {
            let row = long.row(step);
            long.set("validation", row, Some(value));
        }
        let rows = long.downsample_min_max(40);
        assert!(rows.len() <= 40 && rows.is_sorted(), "{rows:?}");
        assert!([617, 311, 250, 500, 750].iter().all(|row| rows.contains(row)), "{rows:?}");
        let short = table((0..5).map(|step| (step, 1.0)));
        assert_eq!(short.downsample_min_max(20).len(), 5);
    }

    #[test]
    fn repeated_steps_are_merged_in_order() {
        let mut table = table([(10, 3.0), (30, 1.0), (20, 2.0), (30, 1.5)]);
        let row = table.row(10);
        table.set("validation", row, Some(7.0));
        table.set("note", row, json!("not a number").as_f64());
        let all = table.downsample_min_max(100);
        let expected = json!({
            "step": [10, 20, 30], "loss": [3, 2, 1.5], "validation": [7, null, null],
            "note": [null, null, null],
        });
        assert_eq!(Value::Object(table.columns(&all)), expected);
        assert_eq!(table.csv(&all), "step,loss,validation,note\n10,3,7,\n20,2,,\n30,1.5,,\n");
        let lines = table.ndjson(&all);
        let lines: Vec<Value> = lines.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
        assert_eq!(lines[0], json!({ "step": 10, "loss": 3, "validation": 7 }));
        assert_eq!((lines.len(), &lines[2]), (3, &json!({ "step": 30, "loss": 1.5 })));
    }
}
