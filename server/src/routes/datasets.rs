//! Datasets that jobs made.

use super::Jobs;
use super::jobs::limit;
use crate::Problem;
use crate::engine::Engine;
use crate::extract::{Path, Query};
use crate::store::RecordKind;
use axum::Json;
use axum::response::{IntoResponse, Response};
use dataset::Dataset;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// All of them, newest first.
#[utoipa::path(
    get, path = "/datasets", tag = "datasets",
    params(("after" = Option<String>, Query), ("limit" = Option<i64>, Query, minimum = 1, maximum = 100)),
    responses((status = 200, description = "Datasets, newest first", body = Page<Object>)),
)]
pub(crate) async fn list(
    Jobs(engine): Jobs,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Json<Value>, Problem> {
    let asked = query.get("limit").map_or(Ok(20), |text| limit(text))?;
    let after = query.get("after").map(String::as_str);
    let mut records = engine.store.records(RecordKind::Dataset, after, asked + 1).await?;
    let has_more = records.len() as i64 > asked;
    records.truncate(asked as usize);
    Ok(Json(json!({ "object": "list", "data": records, "has_more": has_more })))
}

/// One of them.
#[utoipa::path(
    get, path = "/datasets/{id}", tag = "datasets", params(("id" = String, Path)),
    responses((status = 200, description = "What is in it", body = Object)),
)]
pub(crate) async fn get(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    Ok(Json(find(&engine, &id).await?))
}

async fn find(engine: &Engine, id: &str) -> Result<Value, Problem> {
    let record = engine.store.record(RecordKind::Dataset, id).await?;
    record.ok_or_else(|| Problem::no_record("dataset", id))
}

/// One demonstration: name and pose of its object, joint positions and velocities row by row, 30 a second.
#[utoipa::path(
    get, path = "/datasets/{id}/episodes/{index}", tag = "datasets", params(("id" = String, Path), ("index" = usize, Path)),
    responses((status = 200, description = "One demonstration, row by row", body = Object)),
)]
pub(crate) async fn episode(
    Jobs(engine): Jobs,
    Path((id, index)): Path<(String, usize)>,
) -> Result<Response, Problem> {
    let record = find(&engine, &id).await?;
    let folder = engine.dataset_folder(record["hash"].as_str().unwrap_or_default());
    let read = move || Dataset::open(&folder)?.episode(index);
    let read = tokio::task::spawn_blocking(read).await.map_err(std::io::Error::other);
    let kept = read.map_err(|error| Problem::unreadable(&error))?;
    let kept = kept.map_err(|error| Problem::no_episode(&error.to_string()))?;
    let rows: Vec<&[f32]> = kept.states.chunks_exact(dataset::part::STATE).collect();
    Ok(Json(json!({
        "object": "episode", "dataset_id": id, "index": index, "of": kept.object,
        "pose": kept.pose, "pose_index": kept.pose_index, "rows": rows,
    }))
    .into_response())
}
