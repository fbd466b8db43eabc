//! Metrics of a job as a table: JSON, CSV or NDJSON.

use super::jobs::find_job;
use super::metric_table::MetricTable;
use super::{RequireScheduler, schemas};
use crate::Problem;
use crate::extract::{Path, Query};
use crate::jobs::Job;
use crate::jobs::scheduler::JobScheduler;
use crate::store::MIN_CHUNK_EVENTS;
use axum::Json;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Default number of returned rows.
const DEFAULT_POINTS: usize = 1000;

/// Maximum number of returned rows.
const MAX_POINTS: usize = 100_000;

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
    scheduler: &Arc<JobScheduler>,
    job: &Job,
    after: u64,
    is_requested: impl Fn(&str) -> bool,
) -> Result<MetricTable, Problem> {
    let started = job.started_at.unwrap_or(job.created_at);
    let (mut table, mut last, mut unstored) = (MetricTable::default(), 0, 0);
    loop {
        let chunks = scheduler.store.metrics(&job.id, last).await?;
        let Some(newest) = chunks.last() else { break };
        last = newest.last_seq;
        for chunk in &chunks {
            table.add(chunk, started, after, &is_requested);
            unstored += if chunk.is_stored { 0 } else { chunk.steps.len() };
        }
    }
    // Events of versions without chunks; the first request is slow.
    if unstored as i64 >= MIN_CHUNK_EVENTS {
        let (scheduler, id) = (scheduler.clone(), job.id.clone());
        tokio::spawn(async move {
            if let Err(error) = scheduler.store.copy_metrics(&id).await {
                tracing::warn!(job = id, %error, "cannot store the metrics as columns");
            }
        });
    }
    Ok(table)
}
