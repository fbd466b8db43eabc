//! What a job measured, as columns of numbers.

use super::jobs::find;
use super::{Jobs, answers};
use crate::Problem;
use crate::engine::Engine;
use crate::extract::{Path, Query};
use crate::job::Job;
use crate::store::Type;
use axum::Json;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use chrono::{DateTime, Utc};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Points of a course that are given at most, unless asked otherwise.
const STANDARD_POINTS: usize = 1000;

/// The same, whatever is asked.
const MOST_POINTS: usize = 100_000;

/// Events in memory at a time.
const READ_AT_A_TIME: i64 = 4096;

/// What a job measured, in columns; thinned so that no peak is lost.
#[utoipa::path(
    get, path = "/jobs/{id}/metrics", tag = "events",
    params(("id" = String, Path, description = "Id of the job"), ("keys" = Option<String>, Query, description = "Names with commas"), ("after_step" = Option<usize>, Query), ("max_points" = Option<usize>, Query), ("format" = Option<String>, Query, description = "json, csv or ndjson")),
    responses((
        status = 200, description = "Columns of numbers, thinned so that no peak is lost",
        content((answers::Columns = "application/json"), (String = "text/csv"), (String = "application/x-ndjson")),
    )),
)]
pub(crate) async fn metrics(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Response, Problem> {
    let whole = |name: &str, otherwise: usize| -> Result<usize, Problem> {
        let Some(text) = query.get(name) else { return Ok(otherwise) };
        text.parse().map_err(|_| Problem::invalid(name, "it is a whole number"))
    };
    let job = find(&engine, &id).await?;
    let (after, points) = (whole("after_step", 0)?, whole("max_points", STANDARD_POINTS)?);
    let is_asked =
        |name: &str| query.get("keys").is_none_or(|keys| keys.split(',').any(|key| key == name));
    let course = course(&engine, &job, after as u64, is_asked).await?;
    let kept = course.thinned(points.min(MOST_POINTS));
    match query.get("format").map(String::as_str) {
        None | Some("json") => Ok(Json(course.columns(&kept)).into_response()),
        Some("ndjson") => {
            let text = course.ndjson(&kept);
            Ok(([(header::CONTENT_TYPE, "application/x-ndjson")], text).into_response())
        }
        Some("csv") => {
            let text = course.csv(&kept);
            Ok(([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], text).into_response())
        }
        Some(_) => Err(Problem::invalid("format", "it is json, csv or ndjson")),
    }
}

/// All that a job measured after a step (0: from the beginning on).
async fn course(
    engine: &Engine,
    job: &Job,
    after: u64,
    is_asked: impl Fn(&str) -> bool,
) -> Result<Course, Problem> {
    let began = job.started_at.unwrap_or(job.created_at);
    let (mut course, ids, mut last) = (Course::default(), [job.id.clone()], 0);
    loop {
        let page = engine.store.events(&ids, Some(Type::Metric), last, READ_AT_A_TIME).await?;
        let Some(newest) = page.last() else { break };
        last = newest.seq;
        for mut event in page {
            let at = event.json["created_at"].as_str().and_then(|at| at.parse().ok());
            let since = |at: DateTime<Utc>| (at - began).num_milliseconds() as f64 / 1e3;
            let Value::Object(mut values) = event.json["data"].take() else { continue };
            let Some(step) = values.remove("step").and_then(|step| step.as_u64()) else { continue };
            if step > after || after == 0 {
                values.retain(|name, _| is_asked(name));
                let row = course.row(step);
                for (name, value) in &values {
                    course.set(name, row, value.as_f64());
                }
                course.set(WALL, row, at.map(since));
            }
        }
    }
    Ok(course)
}

/// Name of the column of the time since the job began (s).
const WALL: &str = "wall";

/// What a job measured, in columns: a million rows of seven take 60 MB.
#[derive(Debug, Default)]
struct Course {
    /// Steps, in order, each once.
    steps: Vec<u64>,
    /// Names, in the order in which they were first measured, and a number for each step; not a number where there is
    /// none.
    columns: Vec<(String, Vec<f64>)>,
}

impl Course {
    /// The row of a step: what a process did again counts once.
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

    /// Writes down what was measured; of what is no number nothing is kept.
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

    /// Of a column in a row; a whole number without a point.
    fn cell(values: &[f64], row: usize) -> Value {
        let value = values.get(row).copied().unwrap_or(f64::NAN);
        let is_whole = value.fract() == 0.0 && value.abs() < 1e15;
        if is_whole { json!(value as i64) } else { json!(value) }
    }

    fn columns(&self, rows: &[usize]) -> Map<String, Value> {
        let steps = rows.iter().map(|row| json!(self.steps[*row])).collect();
        let mut columns = Map::from_iter([("step".to_owned(), steps)]);
        for (name, values) in &self.columns {
            columns.insert(name.clone(), rows.iter().map(|row| Self::cell(values, *row)).collect());
        }
        columns
    }

    fn ndjson(&self, rows: &[usize]) -> String {
        let line = |row: &usize| {
            let mut values = Map::from_iter([("step".to_owned(), json!(self.steps[*row]))]);
            let cells = self.columns.iter().map(|(name, of)| (name.clone(), Self::cell(of, *row)));
            values.extend(cells.filter(|(_, cell)| !cell.is_null()));
            format!("{}\n", Value::Object(values))
        };
        rows.iter().map(line).collect()
    }

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

    /// At most about `points` rows: of each stretch the least and the greatest of every column but the time, in their
    /// order.
    fn thinned(&self, points: usize) -> Vec<usize> {
        if self.steps.len() <= points.max(2) {
            return (0..self.steps.len()).collect();
        }
        let columns = || self.columns.iter().filter(|(name, _)| name != WALL);
        let stretches = (points / (2 * columns().count().max(1))).max(1);
        let mut kept = BTreeSet::new();
        for (_, values) in columns() {
            let known: Vec<usize> =
                (0..values.len()).filter(|row| !values[*row].is_nan()).collect();
            // A column that has few values is cut where it has them.
            for stretch in 0..stretches {
                let [first, end] = [stretch, stretch + 1].map(|k| k * known.len() / stretches);
                let order = |a: &&usize, b: &&usize| values[**a].total_cmp(&values[**b]);
                let part = &known[first..end];
                kept.extend(part.iter().min_by(order));
                kept.extend(part.iter().max_by(order));
            }
        }
        kept.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course(steps: impl IntoIterator<Item = (u64, f64)>) -> Course {
        let mut course = Course::default();
        for (step, loss) in steps {
            let row = course.row(step);
            course.set("loss", row, Some(loss));
        }
        course
    }

    #[test]
    fn thinning_keeps_the_peaks_and_the_order() {
        let mut long = course((0..1000).map(|step| match step {
            617 => (step, 9.0),
            311 => (step, 0.1),
            _ => (step, 1.0),
        }));
        // Another column has few values.
        for (step, value) in [(250, 1.0), (500, 7.0), (750, 2.0)] {
            let row = long.row(step);
            long.set("exam", row, Some(value));
        }
        let kept = long.thinned(40);
        assert!(kept.len() <= 40 && kept.is_sorted(), "{kept:?}");
        assert!([617, 311, 250, 500, 750].iter().all(|row| kept.contains(row)), "{kept:?}");
        let short = course((0..5).map(|step| (step, 1.0)));
        assert_eq!(short.thinned(20).len(), 5);
    }

    #[test]
    fn what_is_done_again_counts_once_and_in_order() {
        let mut course = course([(10, 3.0), (30, 1.0), (20, 2.0), (30, 1.5)]);
        let row = course.row(10);
        course.set("exam", row, Some(7.0));
        course.set("note", row, json!("no number").as_f64());
        let all = course.thinned(100);
        let wanted = json!({
            "step": [10, 20, 30], "loss": [3, 2, 1.5], "exam": [7, null, null], "note": [null, null, null],
        });
        assert_eq!(Value::Object(course.columns(&all)), wanted);
        assert_eq!(course.csv(&all), "step,loss,exam,note\n10,3,7,\n20,2,,\n30,1.5,,\n");
        let lines = course.ndjson(&all);
        let lines: Vec<Value> = lines.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
        assert_eq!(lines[0], json!({ "step": 10, "loss": 3, "exam": 7 }));
        assert_eq!((lines.len(), &lines[2]), (3, &json!({ "step": 30, "loss": 1.5 })));
    }
}
