//! Metrics of a job as a table: JSON, CSV or NDJSON.

use super::jobs::find_job;
use super::metric_table::Selection;
use super::{RequireScheduler, schemas};
use crate::extract::{Parameters, Path};
use crate::jobs::scheduler::JobScheduler;
use crate::{AppState, Problem};
use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
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
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    parameters: Parameters,
) -> Result<Response, Problem> {
    let query = parameters.only(&["keys", "after_step", "max_points", "format"])?;
    let integer = |name: &str, default: usize| -> Result<usize, Problem> {
        let Some(text) = query.get(name) else { return Ok(default) };
        text.parse().map_err(|_| Problem::invalid_parameter(name, "must be a non-negative integer"))
    };
    let job = find_job(&scheduler, &id).await?;
    let points = integer("max_points", DEFAULT_POINTS)?.min(MAX_POINTS);
    let selection = Selection {
        after_step: integer("after_step", 0)? as u64,
        max_points: points,
        keys: query.get("keys").cloned(),
    };
    let shared = state.metric_cache.table(&id);
    let mut cached = shared.lock().await;
    if cached.update(&scheduler.store, &job).await? {
        store_as_columns(scheduler.clone(), id);
    }
    let rows = cached.rows(&selection);
    let table = &cached.table;
    match query.get("format").map(String::as_str) {
        None | Some("json") => Ok(Json(table.columns(&selection, &rows)).into_response()),
        Some("ndjson") => {
            let text = table.ndjson(&selection, &rows);
            Ok(([(header::CONTENT_TYPE, "application/x-ndjson")], text).into_response())
        }
        Some("csv") => {
            let text = table.csv(&selection, &rows);
            Ok(([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], text).into_response())
        }
        Some(_) => Err(Problem::invalid_parameter("format", "must be json, csv or ndjson")),
    }
}

/// Stores the metrics of a job as columns, in the background.
fn store_as_columns(scheduler: Arc<JobScheduler>, job: String) {
    tokio::spawn(async move {
        if let Err(error) = scheduler.store.copy_metrics(&job).await {
            tracing::warn!(job, %error, "cannot store the metrics as columns");
        }
    });
}
