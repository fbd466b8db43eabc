//! Meshes that are uploaded: the same bytes are the same mesh.

use super::Jobs;
use super::jobs::limit;
use crate::extract::{Path, Query};
use crate::store::RecordKind;
use crate::{AppState, Problem};
use axum::Json;
use axum::body::Body;
use axum::extract::multipart::MultipartError;
use axum::extract::{FromRequest, Multipart, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use chrono::Utc;
use geometry::mesh::{self, MAX_BYTES, Report};
use http_body_util::{BodyExt, Limited};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::sync::Semaphore;

/// Characters of a file's name that are kept.
const MOST_NAME: usize = 100;

/// Takes a mesh, raw or as the first file of a form, and says what it is.
#[utoipa::path(
    post, path = "/meshes", tag = "meshes", params(("name" = Option<String>, Query, description = "Name of the file")),
    request_body(content = Vec<u8>, content_type = "application/octet-stream", description = "OBJ, STL, PLY or GLB; or a form with a file"),
    responses((status = 201, description = "What the mesh is", body = Object), (status = 200, description = "The same bytes are there", body = Object)),
)]
pub(crate) async fn upload(
    State(state): State<AppState>,
    Jobs(engine): Jobs,
    Query(query): Query<BTreeMap<String, String>>,
    request: Request,
) -> Result<Response, Problem> {
    state.limits.leave_space(engine.data())?;
    let most = state.limits.kept_mesh_bytes;
    if engine.store.bytes_of(RecordKind::Mesh).await? >= most {
        return Err(Problem::meshes_full(most));
    }
    let given = query.get("name").cloned();
    let read = tokio::time::timeout(MOST_TIME, read(given, request)).await;
    let (name, bytes) = read.map_err(|_| Problem::too_slow(MOST_TIME))??;
    let name = plain(&name);
    state.metrics.uploaded.inc_by(bytes.len() as u64);
    let _one_of_few = INSPECTIONS.acquire().await;
    let inspected = tokio::task::spawn_blocking(move || {
        let report = mesh::import(&bytes, None).and_then(|import| Report::of(&import));
        (report, bytes)
    });
    let (report, bytes) = inspected.await.map_err(|_| Problem::unusable_mesh(UNREADABLE))?;
    let report = report.map_err(|error| Problem::unusable_mesh(&error.to_string()))?;
    let id = format!("msh_{}", &blake3::hash(&bytes).to_hex()[..16]);
    if let Some(known) = engine.store.record(RecordKind::Mesh, &id).await? {
        return Ok(Json(known).into_response());
    }
    let artifact = engine.store.keep_bytes(&id, &name, bytes).await?;
    let record = json!({
        "id": id, "object": "mesh", "name": name, "hash": artifact.hash, "bytes": artifact.bytes,
        "created_at": Utc::now(), "report": report,
        "urls": {
            "self": format!("/api/v1/meshes/{id}"), "file": format!("/api/v1/meshes/{id}/file"),
        },
    });
    engine.store.add_record(RecordKind::Mesh, &id, &record).await?;
    let location = [(header::LOCATION, format!("/api/v1/meshes/{id}"))];
    Ok((StatusCode::CREATED, location, Json(record)).into_response())
}

/// How long an upload may take: the largest one at 100 kB/s.
const MOST_TIME: Duration = Duration::from_secs(600);

/// Meshes that are looked into at a time: what they become in memory is many times what they are in a file.
static INSPECTIONS: Semaphore = Semaphore::const_new(4);

const UNREADABLE: &str = "it could not be read. Try another file";

/// Name and bytes of what is uploaded; refused as soon as it is known to be too long.
async fn read(given: Option<String>, request: Request) -> Result<(String, Vec<u8>), Problem> {
    // A body cannot be shared between threads, so nothing of the request is held while it is read.
    let headers = request.headers().clone();
    let header = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let length: Option<usize> = header(header::CONTENT_LENGTH).and_then(|text| text.parse().ok());
    // A form has some text about it.
    if length.is_some_and(|length| length > MAX_BYTES + 4096) {
        return Err(Problem::too_large(MAX_BYTES));
    }
    let is_form =
        header(header::CONTENT_TYPE).is_some_and(|kind| kind.starts_with("multipart/form-data"));
    if !is_form {
        let bytes = limited(request.into_body()).await?;
        return Ok((given.unwrap_or_else(|| "mesh".into()), bytes));
    }
    let (parts, body) = request.into_parts();
    let request = Request::from_parts(parts, Body::new(Limited::new(body, MAX_BYTES + 4096)));
    let bad = |error: MultipartError| match error.status() {
        StatusCode::PAYLOAD_TOO_LARGE => Problem::too_large(MAX_BYTES),
        _ => Problem::malformed_form(&error.body_text()),
    };
    let mut form = Multipart::from_request(request, &())
        .await
        .map_err(|error| Problem::malformed_form(&error.body_text()))?;
    while let Some(field) = form.next_field().await.map_err(bad)? {
        let Some(file_name) = field.file_name().map(str::to_owned) else { continue };
        let bytes = field.bytes().await.map_err(bad)?;
        return Ok((given.unwrap_or(file_name), bytes.to_vec()));
    }
    Err(Problem::malformed_form("the form has no file"))
}

async fn limited(body: Body) -> Result<Vec<u8>, Problem> {
    match Limited::new(body, MAX_BYTES).collect().await {
        Ok(read) => Ok(read.to_bytes().to_vec()),
        Err(error) if error.is::<http_body_util::LengthLimitError>() => {
            Err(Problem::too_large(MAX_BYTES))
        }
        Err(error) => Err(Problem::broken_off(&error.to_string())),
    }
}

/// A name without folders or anything that is not shown.
fn plain(name: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let shown: String = last.chars().filter(|c| !c.is_control()).take(MOST_NAME).collect();
    if shown.trim_matches('.').is_empty() { "mesh".into() } else { shown }
}

/// All of them, newest first.
#[utoipa::path(
    get, path = "/meshes", tag = "meshes",
    params(("after" = Option<String>, Query), ("limit" = Option<i64>, Query, minimum = 1, maximum = 100)),
    responses((status = 200, description = "Meshes, newest first", body = Page<Object>)),
)]
pub(crate) async fn list(
    Jobs(engine): Jobs,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Json<Value>, Problem> {
    let asked = query.get("limit").map_or(Ok(20), |text| limit(text))?;
    let after = query.get("after").map(String::as_str);
    let mut records = engine.store.records(RecordKind::Mesh, after, asked + 1).await?;
    let has_more = records.len() as i64 > asked;
    records.truncate(asked as usize);
    Ok(Json(json!({ "object": "list", "data": records, "has_more": has_more })))
}

/// What is known of one.
#[utoipa::path(
    get, path = "/meshes/{id}", tag = "meshes", params(("id" = String, Path)),
    responses((status = 200, description = "What the mesh is", body = Object)),
)]
pub(crate) async fn get(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    let record = engine.store.record(RecordKind::Mesh, &id).await?;
    Ok(Json(record.ok_or_else(|| Problem::no_record("mesh", &id))?))
}

/// Its bytes.
#[utoipa::path(
    get, path = "/meshes/{id}/file", tag = "meshes", params(("id" = String, Path)),
    responses((status = 200, description = "Its bytes", content_type = "application/octet-stream", body = Vec<u8>)),
)]
pub(crate) async fn file(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let record = engine.store.record(RecordKind::Mesh, &id).await?;
    let record = record.ok_or_else(|| Problem::no_record("mesh", &id))?;
    super::artifacts::serve(&engine, record["hash"].as_str().unwrap_or_default(), &headers).await
}

/// Forgets one; jobs that have begun with it have a copy.
#[utoipa::path(
    delete, path = "/meshes/{id}", tag = "meshes", params(("id" = String, Path)),
    responses((status = 204, description = "It is forgotten")),
)]
pub(crate) async fn delete(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    if engine.store.record(RecordKind::Mesh, &id).await?.is_none() {
        return Err(Problem::no_record("mesh", &id));
    }
    engine.store.forget(RecordKind::Mesh, &id).await?;
    engine.store.forget_files(&id).await?;
    Ok(StatusCode::NO_CONTENT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_leads_nowhere() {
        for (given, kept) in [
            ("mug.stl", "mug.stl"),
            ("../../etc/passwd", "passwd"),
            ("C:\\temp\\mug.obj", "mug.obj"),
            ("..", "mesh"),
            ("", "mesh"),
            ("a\0b\nc", "abc"),
        ] {
            assert_eq!(plain(given), kept, "{given:?}");
        }
        assert_eq!(plain(&"x".repeat(1000)).len(), MOST_NAME);
    }
}
