//! Metrics of a job as a table: rows are training steps.

use crate::store::MetricChunk;
use chrono::{DateTime, Utc};
use serde_json::{Map, Value, json};

/// Rows and columns that a request selects.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Selection {
    /// Only later steps; 0 selects all.
    pub(super) after_step: u64,
    /// Approximate maximum number of rows.
    pub(super) max_points: usize,
    /// Names of the metrics, separated by commas; `None` selects all.
    pub(super) keys: Option<String>,
}

impl Selection {
    fn is_requested(&self, name: &str) -> bool {
        self.keys.as_ref().is_none_or(|keys| keys.split(',').any(|key| key == name))
    }
}

/// Name of the column with the time since the job started (s).
const ELAPSED: &str = "elapsed_s";

/// Metrics by training step, in columns. A million rows with seven columns need 60 MB.
#[derive(Debug, Default)]
pub(super) struct MetricTable {
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

    /// Sets a value; NaN keeps the value of an earlier event of the step.
    fn set(&mut self, name: &str, row: usize, value: f64) {
        let values = self.column(name);
        if values.len() <= row {
            values.resize(row + 1, f64::NAN);
        }
        if !value.is_nan() {
            values[row] = value;
        }
    }

    /// Adds the rows of a chunk.
    pub(super) fn add(&mut self, chunk: &MetricChunk, started: DateTime<Utc>) {
        let started_us = started.timestamp_micros();
        let elapsed = |time_ms: &i64| (time_ms * 1000 - started_us) as f64 / 1e6;
        let first = chunk.steps.first().copied().unwrap_or_default();
        let is_later = self.steps.last().is_none_or(|last| *last < first);
        if is_later && chunk.steps.is_sorted_by(|one, next| one < next) {
            let row = self.steps.len();
            self.steps.extend(&chunk.steps);
            for (name, values) in &chunk.columns {
                self.extend(name, row, values.iter().copied());
            }
            self.extend(ELAPSED, row, chunk.times_ms.iter().map(elapsed));
            return;
        }
        for (index, step) in chunk.steps.iter().enumerate() {
            let row = self.row(*step);
            for (name, values) in &chunk.columns {
                self.set(name, row, values[index]);
            }
            self.set(ELAPSED, row, elapsed(&chunk.times_ms[index]));
        }
    }

    /// Number of values.
    pub(super) fn len(&self) -> usize {
        self.steps.len() * (self.columns.len() + 1)
    }

    /// Number of rows up to a step; 0 for the step 0.
    fn num_rows_up_to(&self, step: u64) -> usize {
        if step == 0 { 0 } else { self.steps.partition_point(|known| *known <= step) }
    }

    /// Values of a column, added if it is new.
    fn column(&mut self, name: &str) -> &mut Vec<f64> {
        let known = self.columns.iter().position(|(known, _)| known == name);
        let column = known.unwrap_or_else(|| {
            self.columns.push((name.to_owned(), Vec::new()));
            self.columns.len() - 1
        });
        &mut self.columns[column].1
    }

    /// Appends values to a column, the first one at `row`.
    fn extend(&mut self, name: &str, row: usize, values: impl Iterator<Item = f64>) {
        let column = self.column(name);
        column.resize(row, f64::NAN);
        column.extend(values);
    }

    /// JSON of a value; integers without a decimal point, NaN as null.
    fn cell(values: &[f64], row: usize) -> Value {
        let value = values.get(row).copied().unwrap_or(f64::NAN);
        let is_integer = value.fract() == 0.0 && value.abs() < 1e15;
        if is_integer { json!(value as i64) } else { json!(value) }
    }

    /// Columns of a selection: the time and the requested ones.
    fn selected<'a>(
        &'a self,
        selection: &'a Selection,
    ) -> impl Iterator<Item = (&'a str, &'a [f64])> {
        let columns = self.columns.iter().map(|(name, values)| (name.as_str(), values.as_slice()));
        columns.filter(|(name, _)| *name == ELAPSED || selection.is_requested(name))
    }

    /// JSON object with one array per column.
    pub(super) fn columns(&self, selection: &Selection, rows: &[usize]) -> Map<String, Value> {
        let steps = rows.iter().map(|row| json!(self.steps[*row])).collect();
        let mut columns = Map::from_iter([("step".to_owned(), steps)]);
        for (name, values) in self.selected(selection) {
            let cells = rows.iter().map(|row| Self::cell(values, *row)).collect();
            columns.insert(name.to_owned(), cells);
        }
        columns
    }

    /// One JSON object per row, without missing values.
    pub(super) fn ndjson(&self, selection: &Selection, rows: &[usize]) -> String {
        let line = |row: &usize| {
            let mut values = Map::from_iter([("step".to_owned(), json!(self.steps[*row]))]);
            let columns = self.selected(selection);
            let cells = columns.map(|(name, of)| (name.to_owned(), Self::cell(of, *row)));
            values.extend(cells.filter(|(_, cell)| !cell.is_null()));
            format!("{}\n", Value::Object(values))
        };
        rows.iter().map(line).collect()
    }

    /// CSV with a header line; missing values are empty.
    pub(super) fn csv(&self, selection: &Selection, rows: &[usize]) -> String {
        let names: Vec<&str> = self.selected(selection).map(|(name, _)| name).collect();
        let mut text = format!("step,{}\n", names.join(","));
        for row in rows {
            let cells = self.selected(selection).map(|(_, of)| match Self::cell(of, *row) {
                Value::Null => String::new(),
                cell => cell.to_string(),
            });
            text += &format!("{},{}\n", self.steps[*row], cells.collect::<Vec<_>>().join(","));
        }
        text
    }

    /// Selects about `max_points` rows: the minimum and maximum of each column, except the time, in each of
    /// equally sized bins. Ascending.
    pub(super) fn downsample_min_max(&self, selection: &Selection) -> Vec<usize> {
        let first = self.num_rows_up_to(selection.after_step);
        if self.steps.len() - first <= selection.max_points.max(2) {
            return (first..self.steps.len()).collect();
        }
        let columns = || self.selected(selection).filter(|(name, _)| *name != ELAPSED);
        let bins = (selection.max_points / (2 * columns().count().max(1))).max(1);
        let mut rows = Vec::new();
        for (_, values) in columns() {
            let known: Vec<usize> =
                (first..values.len()).filter(|row| !values[*row].is_nan()).collect();
            // Bins contain equal numbers of measured values, so sparse columns are covered.
            for bin in 0..bins {
                let [start, end] = [bin, bin + 1].map(|k| k * known.len() / bins);
                rows.extend(extremes(values, &known[start..end]).into_iter().flatten());
            }
        }
        rows.sort_unstable();
        rows.dedup();
        rows
    }
}

/// The first row with the minimum and the last one with the maximum of these rows, without NaN; `None` if there
/// are no rows. A loop, because this crate is compiled with few optimizations.
fn extremes(values: &[f64], rows: &[usize]) -> Option<[usize; 2]> {
    let first = *rows.first()?;
    let ([mut min_row, mut max_row], [mut min, mut max]) = ([first; 2], [values[first]; 2]);
    for row in rows {
        let value = values[*row];
        if value < min {
            (min, min_row) = (value, *row);
        }
        if value >= max {
            (max, max_row) = (value, *row);
        }
    }
    Some([min_row, max_row])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(steps: impl IntoIterator<Item = (u64, f64)>) -> MetricTable {
        let mut table = MetricTable::default();
        for (step, loss) in steps {
            let row = table.row(step);
            table.set("loss", row, loss);
        }
        table
    }

    fn up_to(max_points: usize) -> Selection {
        Selection { after_step: 0, max_points, keys: None }
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
            long.set("validation", row, value);
        }
        let rows = long.downsample_min_max(&up_to(40));
        assert!(rows.len() <= 40 && rows.is_sorted(), "{rows:?}");
        assert!([617, 311, 250, 500, 750].iter().all(|row| rows.contains(row)), "{rows:?}");
        let short = table((0..5).map(|step| (step, 1.0)));
        assert_eq!(short.downsample_min_max(&up_to(20)).len(), 5);
    }

    #[test]
    fn repeated_steps_are_merged_in_order() {
        let mut table = table([(10, 3.0), (30, 1.0), (20, 2.0), (30, 1.5)]);
        let row = table.row(10);
        table.set("validation", row, 7.0);
        table.set("note", row, f64::NAN);
        let (all, selection) = (table.downsample_min_max(&up_to(100)), up_to(100));
        let expected = json!({
            "step": [10, 20, 30], "loss": [3, 2, 1.5], "validation": [7, null, null],
            "note": [null, null, null],
        });
        assert_eq!(Value::Object(table.columns(&selection, &all)), expected);
        assert_eq!(
            table.csv(&selection, &all),
            "step,loss,validation,note\n10,3,7,\n20,2,,\n30,1.5,,\n"
        );
        let lines = table.ndjson(&selection, &all);
        let lines: Vec<Value> = lines.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
        assert_eq!(lines[0], json!({ "step": 10, "loss": 3, "validation": 7 }));
        assert_eq!((lines.len(), &lines[2]), (3, &json!({ "step": 30, "loss": 1.5 })));
    }

    #[test]
    fn chunks_are_merged_by_step() {
        let chunk = |steps: &[u64], loss: &[f64], second: i64| MetricChunk {
            last_seq: 0,
            is_stored: true,
            steps: steps.to_vec(),
            times_ms: vec![1000 * second; steps.len()],
            columns: vec![("loss".into(), loss.to_vec()), ("rate".into(), loss.to_vec())],
        };
        let mut table = MetricTable::default();
        let started = DateTime::from_timestamp(10, 0).unwrap();
        for chunk in [
            chunk(&[10, 20], &[4.0, 3.0], 11),
            // The next worker repeats step 20.
            chunk(&[20, 30], &[2.5, f64::NAN], 12),
            chunk(&[40], &[1.0], 13),
        ] {
            table.add(&chunk, started);
        }
        let selection = Selection { after_step: 10, max_points: 100, keys: Some("loss".into()) };
        let rows = table.downsample_min_max(&selection);
        let expected =
            json!({ "step": [20, 30, 40], "loss": [2.5, null, 1], "elapsed_s": [2, 2, 3] });
        assert_eq!(Value::Object(table.columns(&selection, &rows)), expected);
    }
}
