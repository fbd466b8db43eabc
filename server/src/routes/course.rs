//! What a job measured, as columns of numbers.

use super::Jobs;
use super::jobs::find;
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
    responses((status = 200, description = "Columns of numbers, thinned so that no peak is lost", body = Object)),
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
    let rows = rows(&engine, &job, after as u64, is_asked).await?;
    let mut names: Vec<String> = Vec::new();
    for name in rows.iter().flat_map(|(_, row)| row.keys()) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    let kept = thinned(&rows, &names, points.min(MOST_POINTS));
    match query.get("format").map(String::as_str) {
        None | Some("json") => Ok(Json(columns(&kept, &names)).into_response()),
        Some("ndjson") => {
            Ok(([(header::CONTENT_TYPE, "application/x-ndjson")], ndjson(&kept)).into_response())
        }
        Some("csv") => {
            let text = csv(&kept, &names);
            Ok(([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], text).into_response())
        }
        Some(_) => Err(Problem::invalid("format", "it is json, csv or ndjson")),
    }
}

/// What was measured at a step.
type Row = (u64, Map<String, Value>);

/// All that a job measured after a step (0: from the beginning on), in the order of steps.
async fn rows(
    engine: &Engine,
    job: &Job,
    after: u64,
    is_asked: impl Fn(&str) -> bool,
) -> Result<Vec<Row>, Problem> {
    let began = job.started_at.unwrap_or(job.created_at);
    let mut rows: BTreeMap<u64, Map<String, Value>> = BTreeMap::new();
    let (ids, mut last) = ([job.id.clone()], 0);
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
                values.insert("wall".into(), json!(at.map(since)));
                // What a process did again counts once.
                rows.entry(step).or_default().extend(values);
            }
        }
    }
    Ok(rows.into_iter().collect())
}

fn columns(rows: &[Row], names: &[String]) -> Map<String, Value> {
    let column = |name: &str| -> Value {
        rows.iter().map(|(_, row)| row.get(name).cloned().unwrap_or_default()).collect()
    };
    let steps = rows.iter().map(|(step, _)| json!(step)).collect();
    let mut columns = Map::from_iter([("step".to_owned(), steps)]);
    columns.extend(names.iter().map(|name| (name.clone(), column(name))));
    columns
}

fn ndjson(rows: &[Row]) -> String {
    let line = |(step, row): &Row| {
        let mut row = row.clone();
        row.insert("step".into(), json!(step));
        format!("{}\n", Value::Object(row))
    };
    rows.iter().map(line).collect()
}

fn csv(rows: &[Row], names: &[String]) -> String {
    let mut text = format!("step,{}\n", names.join(","));
    for (step, row) in rows {
        let cells = names.iter().map(|name| row.get(name).map_or(String::new(), cell));
        text += &format!("{step},{}\n", cells.collect::<Vec<_>>().join(","));
    }
    text
}

/// A number as it is, anything else as a text in quotes.
fn cell(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::Number(number) => number.to_string(),
        other => format!("\"{}\"", other.to_string().replace('"', "\"\"")),
    }
}

/// At most about `points` rows: of each stretch the least and the greatest of every column but the time, in their order.
fn thinned(rows: &[Row], names: &[String], points: usize) -> Vec<Row> {
    if rows.len() <= points.max(2) {
        return rows.to_vec();
    }
    let columns: Vec<&String> = names.iter().filter(|name| *name != "wall").collect();
    let stretches = (points / (2 * columns.len().max(1))).max(1);
    let mut kept = BTreeSet::new();
    for name in columns {
        let value = |i: usize| rows[i].1.get(name).and_then(Value::as_f64);
        let known: Vec<(usize, f64)> =
            (0..rows.len()).filter_map(|i| Some((i, value(i)?))).collect();
        // A column that has few values is cut where it has them.
        for stretch in 0..stretches {
            let [first, end] = [stretch, stretch + 1].map(|k| k * known.len() / stretches);
            let order = |a: &&(usize, f64), b: &&(usize, f64)| a.1.total_cmp(&b.1);
            let part = &known[first..end];
            kept.extend(
                [part.iter().min_by(order), part.iter().max_by(order)]
                    .iter()
                    .flatten()
                    .map(|(i, _)| *i),
            );
        }
    }
    kept.into_iter().map(|i| rows[i].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_peaks_and_the_order() {
        let mut rows: Vec<Row> = (0..1000)
            .map(|step| (step, Map::from_iter([("loss".to_owned(), json!(1.0))])))
            .collect();
        rows[617].1.insert("loss".into(), json!(9.0));
        rows[311].1.insert("loss".into(), json!(0.1));
        // Another column has few values.
        for (step, value) in [(250, 1), (500, 7), (750, 2)] {
            rows[step].1.insert("exam".into(), json!(value));
        }
        let names = ["exam", "loss", "wall"].map(str::to_owned);
        let kept = thinned(&rows, &names, 40);
        let steps: Vec<u64> = kept.iter().map(|(step, _)| *step).collect();
        assert!(steps.len() <= 40 && steps.is_sorted(), "{steps:?}");
        assert!([617, 311, 250, 500, 750].iter().all(|step| steps.contains(step)), "{steps:?}");
        assert_eq!(thinned(&rows[..5], &names, 20).len(), 5);
    }
}
