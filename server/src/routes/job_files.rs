//! Checkpoints, output files and logs of jobs.

use super::http_content::{Content, NO_STORE, read_range};
use super::jobs::find_job;
use super::pagination::Page;
use super::{RequireScheduler, schemas};
use crate::Problem;
use crate::extract::{Parameters, Path};
use crate::store::EventType;
use axum::Json;
use axum::body::Body;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::ops::Range;

/// Lists the checkpoints of a training job, oldest first.
#[utoipa::path(
    get, path = "/jobs/{id}/checkpoints", tag = "jobs", params(("id" = String, Path, description = "Id of the job")),
    responses((status = 200, description = "Checkpoints, oldest first", body = Page<schemas::Checkpoint>)),
)]
pub(crate) async fn checkpoints(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    find_job(&scheduler, &id).await?;
    let events = scheduler.store.events(&[id], Some(EventType::Checkpoint), 0, i64::MAX).await?;
    let data: Vec<Value> = events.into_iter().map(|mut event| event.json["data"].take()).collect();
    Ok(Json(json!({ "object": "list", "data": data, "has_more": false })))
}

/// Lists the output files of a job.
#[utoipa::path(
    get, path = "/jobs/{id}/artifacts", tag = "jobs", params(("id" = String, Path, description = "Id of the job")),
    responses((status = 200, description = "Output files", body = Page<schemas::JobArtifact>)),
)]
pub(crate) async fn artifacts(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    find_job(&scheduler, &id).await?;
    let artifacts = scheduler.store.artifacts_of(&id).await?;
    let data: Vec<Value> = artifacts
        .iter()
        .map(|artifact| {
            let mut json = json!(artifact);
            json["url"] = format!("/api/v1/artifacts/{}", artifact.hash).into();
            json
        })
        .collect();
    Ok(Json(json!({ "object": "list", "data": data, "has_more": false })))
}

/// Returns the log of a job: the output of its workers.
///
/// `?tail=` returns the last lines.
#[utoipa::path(
    get, path = "/jobs/{id}/logs", tag = "jobs",
    params(("id" = String, Path, description = "Id of the job"), ("tail" = Option<usize>, Query, description = "Number of lines from the end")),
    responses((status = 200, description = "The log", content_type = "text/plain", body = String), (status = 206, description = "The requested range", content_type = "text/plain", body = String)),
)]
pub(crate) async fn logs(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    parameters: Parameters,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let query = parameters.only(&["tail"])?;
    find_job(&scheduler, &id).await?;
    let path = scheduler.job_dir(&id).join("log.txt");
    if let Some(count) = query.get("tail") {
        let invalid = |_| Problem::invalid_parameter("tail", "must be a number of lines");
        let text = last_lines(&path, count.parse().map_err(invalid)?).await;
        let text = text.map_err(|error| Problem::file_unreadable(&error))?;
        return Ok(([(header::CACHE_CONTROL, NO_STORE)], text).into_response());
    }
    // A queued job has no log file.
    let bytes = tokio::fs::metadata(&path).await.map_or(0, |file| file.len());
    let content_type = "text/plain; charset=utf-8";
    let content = Content { name: "the log", hash: None, bytes, content_type, cache: NO_STORE };
    let body = async |range: Range<u64>| match range.is_empty() {
        // The file may not exist.
        true => Ok(Body::empty()),
        false => read_range(&path, range).await.map_err(|error| Problem::file_unreadable(&error)),
    };
    content.respond(&headers, body).await
}

/// Bytes at the end of a log that are searched for its last lines.
const MAX_TAIL_BYTES: u64 = 1 << 20;

/// Last lines of a file; empty if the file does not exist.
async fn last_lines(path: &std::path::Path, count: usize) -> std::io::Result<String> {
    use tokio::io::{AsyncReadExt, AsyncSeekExt};
    let mut file = match tokio::fs::File::open(path).await {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(String::new()),
        Err(error) => return Err(error),
    };
    let length = file.metadata().await?.len();
    file.seek(std::io::SeekFrom::Start(length.saturating_sub(MAX_TAIL_BYTES))).await?;
    let mut bytes = Vec::new();
    file.take(MAX_TAIL_BYTES).read_to_end(&mut bytes).await?;
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.lines().collect();
    Ok(lines[lines.len().saturating_sub(count)..].iter().map(|line| format!("{line}\n")).collect())
}
