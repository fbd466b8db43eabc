//! Files of a dataset: one by one, and as one archive.

use super::datasets::{find_dataset, open_dataset};
use super::http_content::{Content, IMMUTABLE, read_range};
use super::pagination::Page;
use super::{RequireScheduler, schemas};
use crate::archive::{Archive, Source, receive};
use crate::extract::Path;
use crate::jobs::CommandError;
use crate::jobs::scheduler::JobScheduler;
use crate::store::content_type;
use crate::{AppState, Problem};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use dataset_manifest::{FileEntry, MANIFEST_FILE, Manifest};
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

/// Lists the files of a dataset, the manifest first.
#[utoipa::path(
    get, path = "/datasets/{id}/files", tag = "datasets", params(("id" = String, Path)),
    responses((status = 200, description = "All files, in one page", body = Page<schemas::DatasetFile>)),
)]
pub(crate) async fn files(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    let dataset = DatasetFiles::open(&state, &scheduler, &id).await?;
    let describe = |file: &FileEntry| {
        let url = format!("/api/v1/datasets/{id}/files/{}", file.path);
        json!({ "path": file.path, "bytes": file.bytes, "blake3": file.blake3, "url": url })
    };
    let data: Vec<Value> = dataset.files.iter().map(describe).collect();
    Ok(Json(json!({ "object": "list", "data": data, "has_more": false })))
}

/// Downloads a file of a dataset.
///
/// The ETag is the BLAKE3. Slashes in the path can be sent as `/` or as `%2F`.
#[utoipa::path(
    get, path = "/datasets/{id}/files/{*path}", tag = "datasets",
    params(("id" = String, Path), ("path" = String, Path, description = "Path from the list of files, e.g. meta/info.json")),
    responses(
        (status = 200, description = "The file", content((schemas::Bytes = "application/octet-stream"), (schemas::Bytes = "*/*"))),
        (status = 206, description = "The requested range", content((schemas::Bytes = "application/octet-stream"), (schemas::Bytes = "*/*"))),
        (status = 304, description = "Not modified"),
    ),
)]
pub(crate) async fn file(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    Path((id, path)): Path<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let dataset = DatasetFiles::open(&state, &scheduler, &id).await?;
    let file = dataset.files.iter().find(|file| file.path == path);
    let file = file.ok_or_else(|| Problem::record_not_found("dataset file", &path))?;
    let content = Content {
        name: &file.path,
        hash: Some(&file.blake3),
        bytes: file.bytes,
        content_type: content_type(&file.path),
        cache: IMMUTABLE,
    };
    let source = dataset.folder.join(&file.path);
    let body = async |range| {
        read_range(&source, range).await.map_err(|error| Problem::file_unreadable(&error))
    };
    content.respond(&headers, body).await
}

/// Downloads a dataset as a tar archive.
///
/// The archive has the same bytes each time, so an interrupted download can be resumed with `Range`.
#[utoipa::path(
    get, path = "/datasets/{id}/archive", tag = "datasets", params(("id" = String, Path)),
    responses(
        (status = 200, description = "Tar archive with all files in a folder", content_type = "application/octet-stream", body = schemas::Bytes),
        (status = 206, description = "The requested range", content_type = "application/octet-stream", body = schemas::Bytes),
        (status = 304, description = "Not modified"),
    ),
)]
pub(crate) async fn archive(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let dataset = DatasetFiles::open(&state, &scheduler, &id).await?;
    let mut archive = Archive::default();
    for file in &dataset.files {
        let source = Source::File(dataset.folder.join(&file.path));
        let added = archive.add(&format!("{id}/{}", file.path), source, file.bytes);
        added.map_err(|error| Problem::file_unreadable(&error))?;
    }
    respond_with_archive(archive, &id, &dataset.hash, &headers).await
}

/// Response with an archive. `hash` identifies its contents.
pub(super) async fn respond_with_archive(
    archive: Archive,
    id: &str,
    hash: &str,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let archive = archive.finish();
    let name = format!("{id}.tar");
    let content = Content {
        name: &name,
        hash: Some(hash),
        bytes: archive.len(),
        // Tar has no registered media type.
        content_type: "application/octet-stream",
        cache: IMMUTABLE,
    };
    let response = content.respond(headers, async |range| Ok(archive.read_range(range))).await?;
    let disposition = HeaderValue::from_str(&format!("attachment; filename=\"{name}\""));
    let disposition = disposition.unwrap_or(HeaderValue::from_static("attachment"));
    Ok(([(header::CONTENT_DISPOSITION, disposition)], response).into_response())
}

/// Maximum duration of the verification of an imported dataset: hashes and rows of the largest archive.
const VERIFICATION_TIMEOUT: Duration = Duration::from_secs(3600);

/// Imports a dataset from a tar archive.
///
/// The archive contains the folder of a complete dataset. Its manifest and all rows are verified.
#[utoipa::path(
    post, path = "/datasets", tag = "datasets",
    request_body(content = schemas::Bytes, content_type = "application/octet-stream", description = "Tar archive without compression"),
    responses((status = 201, description = "The new dataset", body = schemas::Dataset), (status = 200, description = "The dataset already exists", body = schemas::Dataset)),
)]
pub(crate) async fn import(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    request: Request,
) -> Result<Response, Problem> {
    let received = receive(&state, &scheduler.uploads_dir(), MANIFEST_FILE, request).await?;
    let root = received.root.clone();
    // The reader rejects paths that leave the folder, before the verification follows them.
    let manifest = tokio::task::spawn_blocking(move || Manifest::read(&root)).await;
    let manifest = manifest.map_err(|error| Problem::file_unreadable(&io::Error::other(error)))?;
    let manifest = manifest.map_err(|error| Problem::invalid_archive(format!("{error:#}")))?;
    verify(&scheduler, &received.root).await?;
    // Files that the manifest does not cover, such as logs.
    for path in &received.paths {
        if path != MANIFEST_FILE && !manifest.files.iter().any(|file| file.path == *path) {
            let deleted = tokio::fs::remove_file(received.root.join(path)).await;
            deleted.map_err(|error| Problem::file_unreadable(&error))?;
        }
    }
    let is_known = scheduler.dataset_dir(&manifest.hash).exists();
    let id = scheduler.add_dataset(&received.root, &manifest.hash, None).await?;
    let record = find_dataset(&scheduler, &id).await?;
    if is_known {
        return Ok(Json(record).into_response());
    }
    let location = [(header::LOCATION, format!("/api/v1/datasets/{id}"))];
    Ok((StatusCode::CREATED, location, Json(record)).into_response())
}

/// Verifies hashes and rows of the dataset in a folder.
async fn verify(scheduler: &JobScheduler, folder: &std::path::Path) -> Result<(), Problem> {
    let args = [OsStr::new("dataset"), OsStr::new("verify"), folder.as_os_str()];
    let verified = scheduler.run_command_within(VERIFICATION_TIMEOUT, args).await;
    verified.map(|_| ()).map_err(|error| match error {
        // Clients do not need the path of the temporary folder.
        CommandError::Failed(reason) => {
            Problem::invalid_archive(reason.replace(&format!("{}/", folder.display()), ""))
        }
        CommandError::Io(error) => Problem::file_unreadable(&error),
    })
}

/// Folder and files of a dataset.
struct DatasetFiles {
    folder: PathBuf,
    /// Hash of the dataset (hex).
    hash: String,
    /// All files, the manifest first.
    files: Vec<FileEntry>,
}

impl DatasetFiles {
    async fn open(state: &AppState, scheduler: &JobScheduler, id: &str) -> Result<Self, Problem> {
        let (folder, _) = open_dataset(scheduler, id).await?;
        let unreadable = |error: io::Error| Problem::file_unreadable(&error);
        let path = folder.join(MANIFEST_FILE);
        let hashed = state.file_hash(path).await.map_err(unreadable)?;
        let hashed = hashed.ok_or_else(|| unreadable(io::ErrorKind::NotFound.into()))?;
        let at = folder.clone();
        let manifest = tokio::task::spawn_blocking(move || Manifest::read(&at)).await;
        let manifest = manifest.map_err(|error| unreadable(io::Error::other(error)))?;
        let manifest =
            manifest.map_err(|error| Problem::incompatible_dataset(&error.to_string()))?;
        let first = FileEntry {
            path: MANIFEST_FILE.into(),
            bytes: hashed.bytes,
            blake3: hashed.blake3.to_hex().to_string(),
        };
        let files = std::iter::once(first).chain(manifest.files).collect();
        Ok(Self { folder, hash: manifest.hash, files })
    }
}
