//! What jobs leave behind: models on their way, files, logs.

use super::content::{Content, NOT_KEPT, part_of};
use super::jobs::find;
use super::list::Page;
use super::{Jobs, answers};
use crate::Problem;
use crate::extract::{Path, Query};
use crate::store::Type;
use axum::Json;
use axum::body::Body;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::Range;

/// Models that it wrote on its way, oldest first.
#[utoipa::path(
    get, path = "/jobs/{id}/checkpoints", tag = "jobs", params(("id" = String, Path, description = "Id of the job")),
    responses((status = 200, description = "Models that it wrote on its way", body = Page<answers::Checkpoint>)),
)]
pub(crate) async fn checkpoints(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    find(&engine, &id).await?;
    let events = engine.store.events(&[id], Some(Type::Checkpoint), 0, i64::MAX).await?;
    let data: Vec<Value> = events.into_iter().map(|mut event| event.json["data"].take()).collect();
    Ok(Json(json!({ "object": "list", "data": data, "has_more": false })))
}

/// Its files.
#[utoipa::path(
    get, path = "/jobs/{id}/artifacts", tag = "jobs", params(("id" = String, Path, description = "Id of the job")),
    responses((status = 200, description = "Its files", body = Page<answers::FileOfJob>)),
)]
pub(crate) async fn artifacts(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    find(&engine, &id).await?;
    let artifacts = engine.store.artifacts_of(&id).await?;
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

/// What its process printed; `?tail=` gives the last lines.
#[utoipa::path(
    get, path = "/jobs/{id}/logs", tag = "jobs",
    params(("id" = String, Path, description = "Id of the job"), ("tail" = Option<usize>, Query, description = "The last so many lines")),
    responses((status = 200, description = "What its process printed", content_type = "text/plain", body = String), (status = 206, description = "A part of it", content_type = "text/plain", body = String)),
)]
pub(crate) async fn logs(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    find(&engine, &id).await?;
    let path = engine.folder(&id).join("log.txt");
    if let Some(count) = query.get("tail") {
        let invalid = |_| Problem::invalid("tail", "it is a number of lines");
        let text = tail(&path, count.parse().map_err(invalid)?).await;
        let text = text.map_err(|error| Problem::unreadable(&error))?;
        return Ok(([(header::CACHE_CONTROL, NOT_KEPT)], text).into_response());
    }
    // A job that has not begun has said nothing.
    let bytes = tokio::fs::metadata(&path).await.map_or(0, |file| file.len());
    let content_type = "text/plain; charset=utf-8";
    let content = Content { name: "the log", hash: None, bytes, content_type, cache: NOT_KEPT };
    let part = async |part: Range<u64>| match part.is_empty() {
        // It may not even be there.
        true => Ok(Body::empty()),
        false => part_of(&path, part).await.map_err(|error| Problem::unreadable(&error)),
    };
    content.answer(&headers, part).await
}

/// Bytes at the end of a log in which its last lines are looked for.
const TAIL_BYTES: u64 = 1 << 20;

/// The last lines of a file; none if there is none.
async fn tail(path: &std::path::Path, count: usize) -> std::io::Result<String> {
    use tokio::io::{AsyncReadExt, AsyncSeekExt};
    let mut file = match tokio::fs::File::open(path).await {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(String::new()),
        Err(error) => return Err(error),
    };
    let length = file.metadata().await?.len();
    file.seek(std::io::SeekFrom::Start(length.saturating_sub(TAIL_BYTES))).await?;
    let mut bytes = Vec::new();
    file.take(TAIL_BYTES).read_to_end(&mut bytes).await?;
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.lines().collect();
    Ok(lines[lines.len().saturating_sub(count)..].iter().map(|line| format!("{line}\n")).collect())
}
