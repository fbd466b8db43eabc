//! Datasets that jobs made.

use super::list::{Page, STANDARD_LIMIT, limit};
use super::{Jobs, answers};
use crate::Problem;
use crate::engine::Engine;
use crate::extract::{Path, Query};
use crate::store::RecordKind;
use axum::Json;
use axum::http::StatusCode;
use dataset::Dataset;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// All of them, newest first.
#[utoipa::path(
    get, path = "/datasets", tag = "datasets",
    params(("after" = Option<String>, Query), ("limit" = Option<i64>, Query, minimum = 1, maximum = 100)),
    responses((status = 200, description = "Datasets, newest first", body = Page<answers::Dataset>)),
)]
pub(crate) async fn list(
    Jobs(engine): Jobs,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Json<Value>, Problem> {
    super::list::records(&engine, RecordKind::Dataset, &query).await
}

/// One of them.
#[utoipa::path(
    get, path = "/datasets/{id}", tag = "datasets", params(("id" = String, Path)),
    responses((status = 200, description = "What is in it", body = answers::Dataset)),
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

/// Forgets one, with its files; refused while a job that has not ended works on it.
#[utoipa::path(
    delete, path = "/datasets/{id}", tag = "datasets", params(("id" = String, Path)),
    responses((status = 204, description = "It is forgotten")),
)]
pub(crate) async fn delete(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    let record = find(&engine, &id).await?;
    engine.not_in_use(&id).await?;
    engine.forget_dataset(&record).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The demonstrations that were kept, in their order.
#[utoipa::path(
    get, path = "/datasets/{id}/episodes", tag = "datasets",
    params(
        ("id" = String, Path),
        ("object" = Option<String>, Query, description = "Only of this object"),
        ("after" = Option<usize>, Query, description = "Only those behind this number"),
        ("limit" = Option<i64>, Query, minimum = 1, maximum = 100),
    ),
    responses((status = 200, description = "Number, object and pose of each", body = Page<answers::Episode>)),
)]
pub(crate) async fn episodes(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Json<Value>, Problem> {
    let asked = query.get("limit").map_or(Ok(STANDARD_LIMIT), |text| limit(text))? as usize;
    let not_a_number = |_| Problem::invalid("after", "it is the number of an episode");
    let after = query.get("after").map(|text| text.parse::<u32>().map_err(not_a_number));
    let first = after.transpose()?.map_or(0, |last| last as usize + 1);
    let object = query.get("object").cloned();
    let read = move |dataset: Dataset| dataset.listed(first, asked + 1, object.as_deref());
    let damaged = |why: String| Problem::unreadable(&std::io::Error::other(why));
    let mut entries = of_dataset(&engine, &id, read).await?.map_err(damaged)?;
    let has_more = entries.len() > asked;
    entries.truncate(asked);
    Ok(Json(json!({ "object": "list", "data": entries, "has_more": has_more })))
}

/// One demonstration as the page plays it: object and its pose, joint positions and velocities row by row, 30 a second.
#[utoipa::path(
    get, path = "/datasets/{id}/episodes/{index}", tag = "datasets", params(("id" = String, Path), ("index" = usize, Path)),
    responses((status = 200, description = "One demonstration, row by row", body = answers::Demonstration)),
)]
pub(crate) async fn episode(
    Jobs(engine): Jobs,
    Path((id, index)): Path<(String, usize)>,
) -> Result<Json<Value>, Problem> {
    let read = of_dataset(&engine, &id, move |dataset| dataset.demonstration(index)).await?;
    Ok(Json(read.map_err(|why| Problem::no_episode(&why))?))
}

/// Reads something of a dataset, or says why that cannot be.
async fn of_dataset<T: Send + 'static, E: std::fmt::Display>(
    engine: &Engine,
    id: &str,
    read: impl FnOnce(Dataset) -> Result<T, E> + Send + 'static,
) -> Result<Result<T, String>, Problem> {
    let record = find(engine, id).await?;
    let folder = engine.dataset_folder(record["hash"].as_str().unwrap_or_default());
    let read = move || {
        let dataset = Dataset::open(&folder).map_err(|error| error.to_string())?;
        Ok::<_, String>(read(dataset).map_err(|error| error.to_string()))
    };
    let read = tokio::task::spawn_blocking(read).await;
    let read = read.map_err(|error| Problem::unreadable(&std::io::Error::other(error)))?;
    read.map_err(|error| Problem::unusable_dataset(&error))
}
