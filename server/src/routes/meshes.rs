//! Meshes that are uploaded: the same bytes are the same mesh.

use super::content::KEPT;
use super::list::Page;
use super::{Jobs, answers, artifacts};
use crate::extract::{Path, Query};
use crate::store::RecordKind;
use crate::{AppState, Problem};
use axum::Json;
use axum::extract::multipart::MultipartError;
use axum::extract::{FromRequest, Multipart, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use chrono::Utc;
use futures_util::StreamExt;
use geometry::mesh::{self, Report};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::Duration;
use tempfile::NamedTempFile;
use tokio::io::AsyncWriteExt;
use tokio::sync::{Mutex, Semaphore};
use utoipa::ToSchema;

/// Characters of a file's name that are kept.
const MOST_NAME: usize = 100;

/// Takes a mesh, raw or as the first file of a form, and says what it is.
#[utoipa::path(
    post, path = "/meshes", tag = "meshes", params(("name" = Option<String>, Query, description = "Name of the file")),
    request_body(content((answers::Bytes = "application/octet-stream"), (Form = "multipart/form-data")), description = "OBJ, STL, PLY, OFF, GLB or glTF"),
    responses((status = 201, description = "What the mesh is", body = answers::Mesh), (status = 200, description = "The same bytes are there", body = answers::Mesh)),
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
    let incoming =
        NamedTempFile::new_in(engine.incoming()).map_err(|error| Problem::unreadable(&error))?;
    let read = tokio::time::timeout(MOST_TIME, read(given, request, &incoming)).await;
    let read = read.map_err(|_| Problem::too_slow(MOST_TIME))?;
    // The disk may have become full meanwhile.
    let name = plain(&read.or_else(|refused| {
        state.limits.leave_space(engine.data())?;
        Err(refused)
    })?);
    let one_of_few = INSPECTIONS.acquire().await;
    let bytes = tokio::fs::read(incoming.path()).await.map_err(|e| Problem::unreadable(&e))?;
    let inspected = tokio::task::spawn_blocking(move || {
        // Whoever hangs up meanwhile does not make room: the work goes on.
        let _one_of_few = one_of_few;
        let report = mesh::import(&bytes, None).and_then(|import| Report::of(&import));
        (report, bytes)
    });
    let (report, bytes) = inspected.await.map_err(|_| Problem::unusable_mesh(UNREADABLE))?;
    let report = report.map_err(|error| Problem::unusable_mesh(&error.to_string()))?;
    let id = format!("msh_{}", &blake3::hash(&bytes).to_hex()[..16]);
    let _alone = KEEPING.lock().await;
    if let Some(known) = engine.store.record(RecordKind::Mesh, &id).await? {
        return Ok(Json(known).into_response());
    }
    // Others may have sent theirs meanwhile.
    state.limits.leave_space(engine.data())?;
    if engine.store.bytes_of(RecordKind::Mesh).await? + bytes.len() as u64 > most {
        return Err(Problem::meshes_full(most));
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
    state.metrics.uploaded.inc_by(artifact.bytes);
    let location = [(header::LOCATION, format!("/api/v1/meshes/{id}"))];
    Ok((StatusCode::CREATED, location, Json(record)).into_response())
}

/// A form with a file.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct Form {
    /// The first file counts, whatever its field is called.
    file: answers::Bytes,
}

/// Held by whoever keeps a mesh or forgets one: a mesh is a file and a record.
static KEEPING: Mutex<()> = Mutex::const_new(());

/// How long an upload may take: the largest one at 100 kB/s.
const MOST_TIME: Duration = Duration::from_secs(600);

/// Meshes that are looked into at a time: what they become in memory is many times what they are in a file.
static INSPECTIONS: Semaphore = Semaphore::const_new(2);

const UNREADABLE: &str = "it could not be read. Try another file";

/// Writes what is uploaded to a file, and gives its name; refused as soon as it is known to be too long. However many
/// send at a time, and however slowly: what they have sent of a file lies on the disk.
async fn read(
    given: Option<String>,
    request: Request,
    incoming: &NamedTempFile,
) -> Result<String, Problem> {
    let unwritable = |error: std::io::Error| Problem::unreadable(&error);
    let mut file = tokio::fs::File::from_std(incoming.reopen().map_err(unwritable)?);
    // A body cannot be shared between threads, so nothing of the request is held while it is read.
    let headers = request.headers().clone();
    let header = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let length: Option<usize> = header(header::CONTENT_LENGTH).and_then(|text| text.parse().ok());
    if length.is_some_and(|length| length > MOST_BYTES + FORM) {
        return Err(Problem::too_large(MOST_BYTES));
    }
    let is_form =
        header(header::CONTENT_TYPE).is_some_and(|kind| kind.starts_with("multipart/form-data"));
    let name = if is_form {
        let mut form = Multipart::from_request(request, &())
            .await
            .map_err(|error| Problem::malformed_form(&error.body_text()))?;
        let bad = |error: MultipartError| match error.status() {
            StatusCode::PAYLOAD_TOO_LARGE => Problem::too_large(MOST_BYTES),
            _ => Problem::malformed_form(&error.body_text()),
        };
        let mut fields = 0;
        let (name, mut field) = loop {
            let field = form.next_field().await.map_err(bad)?;
            let field = field.ok_or_else(|| Problem::malformed_form("the form has no file"))?;
            fields += 1;
            if fields > MOST_FIELDS {
                return Err(Problem::malformed_form("the form has too many fields"));
            }
            if let Some(name) = field.file_name() {
                break (name.to_owned(), field);
            }
        };
        let mut taken = 0;
        while let Some(chunk) = field.chunk().await.map_err(bad)? {
            taken = room(taken, chunk.len())?;
            file.write_all(&chunk).await.map_err(unwritable)?;
        }
        given.unwrap_or(name)
    } else {
        let mut body = request.into_body().into_data_stream();
        let mut taken = 0;
        while let Some(chunk) = body.next().await {
            let chunk = chunk.map_err(|error| Problem::broken_off(&error.to_string()))?;
            taken = room(taken, chunk.len())?;
            file.write_all(&chunk).await.map_err(unwritable)?;
        }
        given.unwrap_or_else(|| "mesh".into())
    };
    file.flush().await.map_err(unwritable)?;
    Ok(name)
}

/// Longest file (bytes); a page reads longer ones, which need not be sent.
pub(super) const MOST_BYTES: usize = 50_000_000;

/// Bytes of a form about its file.
pub(super) const FORM: usize = 4096;

/// Fields of a form before its file.
const MOST_FIELDS: usize = 16;

/// The length with some more bytes, if that is not too long.
fn room(taken: usize, more: usize) -> Result<usize, Problem> {
    Some(taken + more)
        .filter(|all| *all <= MOST_BYTES)
        .ok_or_else(|| Problem::too_large(MOST_BYTES))
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
    responses((status = 200, description = "Meshes, newest first", body = Page<answers::Mesh>)),
)]
pub(crate) async fn list(
    Jobs(engine): Jobs,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Json<Value>, Problem> {
    super::list::records(&engine, RecordKind::Mesh, &query).await
}

/// What is known of one.
#[utoipa::path(
    get, path = "/meshes/{id}", tag = "meshes", params(("id" = String, Path)),
    responses((status = 200, description = "What the mesh is", body = answers::Mesh)),
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
    responses(
        (status = 200, description = "Its bytes", content_type = "*/*", body = answers::Bytes),
        (status = 206, description = "A part of them", content_type = "*/*", body = answers::Bytes),
        (status = 304, description = "They are as If-None-Match says"),
    ),
)]
pub(crate) async fn file(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let record = engine.store.record(RecordKind::Mesh, &id).await?;
    let record = record.ok_or_else(|| Problem::no_record("mesh", &id))?;
    let hash = record["hash"].as_str().unwrap_or_default();
    artifacts::serve(&engine, hash, KEPT, &headers).await
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
    let _alone = KEEPING.lock().await;
    if engine.store.record(RecordKind::Mesh, &id).await?.is_none() {
        return Err(Problem::no_record("mesh", &id));
    }
    engine.store.forget(RecordKind::Mesh, &id).await?;
    engine.store.forget_files(&id, None).await?;
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
