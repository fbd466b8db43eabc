//! Uploaded meshes, identified by their contents: equal bytes are the same mesh.

use super::pagination::Page;
use super::{RequireScheduler, artifacts, schemas};
use crate::extract::{Parameters, Path};
use crate::quotas::ReservedSpace;
use crate::store::RecordKind;
use crate::{AppState, Problem};
use axum::Json;
use axum::extract::multipart::MultipartError;
use axum::extract::{FromRequest, Multipart, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use chrono::Utc;
use futures_util::StreamExt;
use mesh::{MeshOptions, MeshSummary, Unit, UpAxis};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use tempfile::NamedTempFile;
use tokio::io::AsyncWriteExt;
use utoipa::ToSchema;

/// Maximum length of a stored file name (characters).
const MAX_NAME_CHARS: usize = 100;

/// Uploads and inspects a mesh.
///
/// The file is the body, or the only file of a form.
#[utoipa::path(
    post, path = "/meshes", tag = "meshes", params(
        ("name" = Option<String>, Query, description = "File name"),
        ("unit" = Option<String>, Query, description = "Unit of the mesh: m, cm, mm or in"),
        ("size_m" = Option<f32>, Query, description = "Length of the longest side (m), instead of unit and scale"),
        ("scale" = Option<f32>, Query, description = "Factor on the coordinates, in addition to the unit"),
        ("up" = Option<String>, Query, description = "Axis of the file that points up: x, y or z"),
    ),
    request_body(content((schemas::Bytes = "application/octet-stream"), (MeshForm = "multipart/form-data")), description = mesh::format_list()),
    responses((status = 201, description = "The new mesh", body = schemas::Mesh), (status = 200, description = "The mesh already exists; its summary is that of this request", body = schemas::Mesh)),
)]
pub(crate) async fn upload(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    parameters: Parameters,
    request: Request,
) -> Result<Response, Problem> {
    let query = parameters.only(&["name", "unit", "size_m", "scale", "up"])?;
    let _reserved = reserve_space(&state, scheduler.data_dir(), request.headers())?;
    let max_total = state.quotas.max_total_mesh_bytes;
    if scheduler.store.total_bytes(RecordKind::Mesh).await? >= max_total {
        return Err(Problem::mesh_quota_exceeded(max_total));
    }
    let given_name = query.get("name").cloned();
    let options = mesh_options(&query)?;
    let upload = NamedTempFile::new_in(scheduler.uploads_dir())
        .map_err(|error| Problem::file_unreadable(&error))?;
    let received =
        tokio::time::timeout(UPLOAD_TIMEOUT, receive(given_name, request, &upload)).await;
    let received = received.map_err(|_| Problem::request_timeout(UPLOAD_TIMEOUT))?;
    // Reports a full disk instead, if that is the cause.
    let name = sanitize_name(&received.or_else(|problem| {
        state.quotas.ensure_free_space(scheduler.data_dir())?;
        Err(problem)
    })?);
    let permit = state.mesh_locks.inspections.clone().acquire_owned().await;
    let bytes = tokio::fs::read(upload.path()).await.map_err(|e| Problem::file_unreadable(&e))?;
    let inspected = tokio::task::spawn_blocking(move || {
        // Held until the inspection ends, even if the client disconnects.
        let _permit = permit;
        let summary = mesh::import(&bytes, &options).and_then(|import| MeshSummary::of(&import));
        let is_size_required = options.has_size() && {
            let error = mesh::import(&bytes, &MeshOptions::default()).err();
            error.is_some_and(|error| error.code() == "size_required")
        };
        (summary, is_size_required, bytes)
    });
    let (summary, is_size_required, bytes) = inspected
        .await
        .map_err(|_| Problem::invalid_mesh(PARSER_PANICKED.map(str::to_owned).into()))?;
    let summary = summary.map_err(|error| Problem::unusable_mesh(&error))?;
    let id = format!("msh_{}", &blake3::hash(&bytes).to_hex()[..16]);
    let _guard = state.mesh_locks.records.lock().await;
    if let Some(mut known) = scheduler.store.record(RecordKind::Mesh, &id).await? {
        // The same file with another unit, size or up axis.
        let summary = json!(summary);
        if known["summary"] != summary {
            known["summary"] = summary;
            scheduler.store.replace_record(RecordKind::Mesh, &id, &known).await?;
        }
        return Ok(Json(known).into_response());
    }
    // Checked again, because concurrent uploads may have used the space.
    state.quotas.ensure_free_space(scheduler.data_dir())?;
    if scheduler.store.total_bytes(RecordKind::Mesh).await? + bytes.len() as u64 > max_total {
        return Err(Problem::mesh_quota_exceeded(max_total));
    }
    let artifact = scheduler.store.put_bytes(&id, &name, bytes).await?;
    let record = json!({
        "id": id, "object": "mesh", "name": name, "hash": artifact.hash, "bytes": artifact.bytes,
        "created_at": Utc::now(), "summary": summary, "size_required": is_size_required,
        "urls": {
            "self": format!("/api/v1/meshes/{id}"), "file": format!("/api/v1/meshes/{id}/file"),
        },
    });
    scheduler.store.add_record(RecordKind::Mesh, &id, &record).await?;
    state.metrics.uploaded_bytes.inc_by(artifact.bytes);
    let location = [(header::LOCATION, format!("/api/v1/meshes/{id}"))];
    Ok((StatusCode::CREATED, location, Json(record)).into_response())
}

/// Reserves disk space for an upload: twice its length, because it is copied to the artifacts. Rejects the upload
/// if less than the minimum would remain free with all concurrent uploads.
fn reserve_space(
    state: &AppState,
    folder: &std::path::Path,
    headers: &HeaderMap,
) -> Result<ReservedSpace, Problem> {
    let length = headers.get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok());
    let length = length.and_then(|text| text.parse().ok()).unwrap_or(MAX_MESH_BYTES as u64);
    let reserved = state.mesh_locks.reserved.reserve(2 * length.min(MAX_MESH_BYTES as u64));
    state.quotas.ensure_free_space_for(folder, reserved.total())?;
    Ok(reserved)
}

/// Options of the mesh in the query.
fn mesh_options(query: &BTreeMap<String, String>) -> Result<MeshOptions, Problem> {
    let invalid = |name: &str, expected: &str| {
        Problem::invalid_parameter(name, format!("expected {expected}"))
    };
    let number = |name: &str| {
        let text = query.get(name);
        let parsed = text.map(|text| text.parse().map_err(|_| invalid(name, "a positive number")));
        parsed.transpose()
    };
    let unit = query
        .get("unit")
        .map(|text| Unit::from_symbol(text).ok_or_else(|| invalid("unit", "m, cm, mm or in")));
    let up = query
        .get("up")
        .map(|text| UpAxis::from_name(text).ok_or_else(|| invalid("up", "x, y or z")));
    let options = MeshOptions {
        unit: unit.transpose()?,
        size: number("size_m")?,
        scale: number("scale")?,
        up: up.transpose()?,
    };
    options.check().map_err(|error| Problem::invalid_parameter("size_m", error.to_string()))?;
    Ok(options)
}

/// Form with a mesh file.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct MeshForm {
    /// The only file of the form; its field name is ignored.
    file: schemas::Bytes,
}

/// Maximum duration of an upload: about the largest file at 100 kB/s.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(600);

/// Message if the parser panics.
const PARSER_PANICKED: [&str; 2] = ["the mesh cannot be parsed", "Try another file"];

/// Writes an upload to a file and returns its name; rejected as soon as it exceeds the size limit. Writing to
/// disk bounds the memory of many slow uploads.
async fn receive(
    given_name: Option<String>,
    request: Request,
    upload: &NamedTempFile,
) -> Result<String, Problem> {
    let started = Instant::now();
    let unwritable = |error: std::io::Error| Problem::file_unreadable(&error);
    let mut file = tokio::fs::File::from_std(upload.reopen().map_err(unwritable)?);
    // The body is not `Sync`, so no reference to the request is held across an await.
    let headers = request.headers().clone();
    let header = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let length: Option<usize> = header(header::CONTENT_LENGTH).and_then(|text| text.parse().ok());
    if length.is_some_and(|length| length > MAX_MESH_BYTES + FORM_OVERHEAD) {
        return Err(Problem::body_too_large(MAX_MESH_BYTES));
    }
    let is_form =
        header(header::CONTENT_TYPE).is_some_and(|kind| kind.starts_with("multipart/form-data"));
    let name = if is_form {
        let mut form = Multipart::from_request(request, &())
            .await
            .map_err(|error| Problem::malformed_form(&error.body_text()))?;
        let form_error = |error: MultipartError| match error.status() {
            StatusCode::PAYLOAD_TOO_LARGE => Problem::body_too_large(MAX_MESH_BYTES),
            _ => Problem::malformed_form(&error.body_text()),
        };
        let mut fields = 0;
        let (name, mut field) = loop {
            let field = form.next_field().await.map_err(form_error)?;
            let field =
                field.ok_or_else(|| Problem::malformed_form("the form contains no file"))?;
            fields += 1;
            if fields > MAX_FORM_FIELDS {
                return Err(Problem::malformed_form("the form has too many fields"));
            }
            if let Some(name) = field.file_name() {
                break (name.to_owned(), field);
            }
        };
        let mut received = 0;
        while let Some(chunk) = field.chunk().await.map_err(form_error)? {
            received = checked_len(received, chunk.len())?;
            check_rate(started, received)?;
            file.write_all(&chunk).await.map_err(unwritable)?;
        }
        drop(field);
        while let Some(field) = form.next_field().await.map_err(form_error)? {
            if field.file_name().is_some() {
                return Err(Problem::malformed_form(
                    "the form contains several files; send one file, for example GLB with its buffers",
                ));
            }
        }
        given_name.unwrap_or(name)
    } else {
        let mut body = request.into_body().into_data_stream();
        let mut received = 0;
        while let Some(chunk) = body.next().await {
            let chunk = chunk.map_err(|error| Problem::incomplete_body(&error.to_string()))?;
            received = checked_len(received, chunk.len())?;
            check_rate(started, received)?;
            file.write_all(&chunk).await.map_err(unwritable)?;
        }
        given_name.unwrap_or_else(|| "mesh".into())
    };
    file.flush().await.map_err(unwritable)?;
    Ok(name)
}

/// Maximum length of a mesh file (bytes). The page itself opens longer files, because it does not upload
/// them.
pub(super) const MAX_MESH_BYTES: usize = 50_000_000;

/// Maximum length of a form in addition to its file (bytes).
pub(super) const FORM_OVERHEAD: usize = 4096;

/// Maximum number of fields before the file of a form.
const MAX_FORM_FIELDS: usize = 16;

/// Sum of the received and additional bytes; rejected above [`MAX_MESH_BYTES`].
fn checked_len(received: usize, additional: usize) -> Result<usize, Problem> {
    Some(received + additional)
        .filter(|total| *total <= MAX_MESH_BYTES)
        .ok_or_else(|| Problem::body_too_large(MAX_MESH_BYTES))
}

/// Time after which the rate of an upload is checked, as for any other body.
const RATE_GRACE: Duration = Duration::from_secs(30);

/// Minimum mean rate of an upload after this time (bytes/s).
const MIN_RATE: f64 = 20_000.0;

/// Rejects an upload that keeps its connection busy with single bytes.
fn check_rate(started: Instant, received: usize) -> Result<(), Problem> {
    let needed = RATE_GRACE + Duration::from_secs_f64(received as f64 / MIN_RATE);
    if started.elapsed() <= needed { Ok(()) } else { Err(Problem::request_timeout(needed)) }
}

/// File name without folders and control characters; `mesh` if nothing remains.
fn sanitize_name(name: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let printable: String = last.chars().filter(|c| !c.is_control()).take(MAX_NAME_CHARS).collect();
    if printable.trim_matches('.').is_empty() { "mesh".into() } else { printable }
}

/// Lists the meshes.
#[utoipa::path(
    get, path = "/meshes", tag = "meshes",
    params(("after" = Option<String>, Query), ("limit" = Option<i64>, Query, minimum = 1, maximum = 100)),
    responses((status = 200, description = "Meshes, newest first", body = Page<schemas::Mesh>)),
)]
pub(crate) async fn list(
    RequireScheduler(scheduler): RequireScheduler,
    parameters: Parameters,
) -> Result<Json<Value>, Problem> {
    super::pagination::list_records(&scheduler, RecordKind::Mesh, parameters).await
}

/// Returns a mesh.
#[utoipa::path(
    get, path = "/meshes/{id}", tag = "meshes", params(("id" = String, Path)),
    responses((status = 200, description = "The mesh", body = schemas::Mesh)),
)]
pub(crate) async fn get(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    let record = scheduler.store.record(RecordKind::Mesh, &id).await?;
    Ok(Json(record.ok_or_else(|| Problem::record_not_found("mesh", &id))?))
}

/// Downloads the file of a mesh.
#[utoipa::path(
    get, path = "/meshes/{id}/file", tag = "meshes", params(("id" = String, Path)),
    responses(
        (status = 200, description = "The file", content((schemas::Bytes = "application/octet-stream"), (schemas::Bytes = "*/*"))),
        (status = 206, description = "The requested range", content((schemas::Bytes = "application/octet-stream"), (schemas::Bytes = "*/*"))),
        (status = 304, description = "Not modified"),
    ),
)]
pub(crate) async fn file(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let record = scheduler.store.record(RecordKind::Mesh, &id).await?;
    let record = record.ok_or_else(|| Problem::record_not_found("mesh", &id))?;
    let hash = record["hash"].as_str().unwrap_or_default();
    let name = record["name"].as_str().unwrap_or_default();
    artifacts::serve_mesh(&scheduler, hash, name, &headers).await
}

/// Deletes a mesh; jobs that have started with it keep a copy.
#[utoipa::path(
    delete, path = "/meshes/{id}", tag = "meshes", params(("id" = String, Path)),
    responses((status = 204, description = "The mesh is deleted")),
)]
pub(crate) async fn delete(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    let _guard = state.mesh_locks.records.lock().await;
    if scheduler.store.record(RecordKind::Mesh, &id).await?.is_none() {
        return Err(Problem::record_not_found("mesh", &id));
    }
    scheduler.store.delete_record(RecordKind::Mesh, &id).await?;
    scheduler.store.delete_files(&id, None).await?;
    Ok(StatusCode::NO_CONTENT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upload_of_single_bytes_is_rejected_after_30_seconds() {
        let before = |seconds| Instant::now().checked_sub(Duration::from_secs(seconds)).unwrap();
        assert!(check_rate(before(29), 5).is_ok());
        assert!(check_rate(before(31), 5).is_err());
        assert!(check_rate(before(100), 2_000_000).is_ok());
    }

    #[test]
    fn file_name_is_stripped_of_folders_and_control_characters() {
        for (given, sanitized) in [
            ("mug.stl", "mug.stl"),
            ("../../etc/passwd", "passwd"),
            ("C:\\temp\\mug.obj", "mug.obj"),
            ("..", "mesh"),
            ("", "mesh"),
            ("a\0b\nc", "abc"),
        ] {
            assert_eq!(sanitize_name(given), sanitized, "{given:?}");
        }
        assert_eq!(sanitize_name(&"x".repeat(1000)).len(), MAX_NAME_CHARS);
    }
}
