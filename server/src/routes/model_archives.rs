//! Archives of models: download and import.

use super::RequireScheduler;
use super::dataset_files::respond_with_archive;
use super::models::{job_model, with_file_urls};
use super::schemas;
use crate::archive::{Archive, Received, Source, receive};
use crate::extract::Path;
use crate::model::{BuiltInModel, ModelFile};
use crate::model_manifest::{MODEL_MANIFEST_FILE, ModelEntry, ModelManifest};
use crate::store::RecordKind;
use crate::{AppState, Problem};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;

/// Downloads a model as a tar archive.
///
/// The archive has the same bytes each time. Another server imports it with `POST /models`.
#[utoipa::path(
    get, path = "/models/{id}/archive", tag = "models", params(("id" = String, Path)),
    responses(
        (status = 200, description = "Tar archive with the files and a manifest in a folder", content_type = "application/octet-stream", body = schemas::Bytes),
        (status = 206, description = "The requested range", content_type = "application/octet-stream", body = schemas::Bytes),
        (status = 304, description = "Not modified"),
    ),
)]
pub(crate) async fn archive(
    State(state): State<AppState>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let id = state.resolve_model_id(&id);
    let unreadable = |error: io::Error| Problem::file_unreadable(&error);
    let mut files = BTreeMap::new();
    let mut sources = Vec::new();
    let (kind, step, params) = match (job_model(&state, id).await?, &state.scheduler) {
        (Some(record), Some(scheduler)) => {
            for (name, file) in record["files"].as_object().into_iter().flatten() {
                let hash = file["blake3"].as_str().unwrap_or_default().to_owned();
                let bytes = file["bytes"].as_u64().unwrap_or_default();
                sources.push((name.clone(), Source::Artifact(Arc::clone(scheduler), hash.clone())));
                files.insert(name.clone(), ModelEntry { bytes, blake3: hash });
            }
            let kind = record["kind"].as_str().unwrap_or("policy").to_owned();
            (kind, record["step"].as_u64(), record["params"].clone())
        }
        _ => {
            let model = BuiltInModel::find(&state, id).await?;
            for file in ModelFile::ALL {
                let path = model.path(file);
                let hashed = state.file_hash(path.clone()).await.map_err(unreadable)?;
                let Some(hashed) = hashed else { continue };
                let blake3 = hashed.blake3.to_hex().to_string();
                let name = file.file_name.to_owned();
                sources.push((name.clone(), Source::File(path)));
                files.insert(name, ModelEntry { bytes: hashed.bytes, blake3 });
            }
            ("policy".to_owned(), None, serde_json::Value::Null)
        }
    };
    let manifest = ModelManifest::new(kind, step, params, files);
    let text = serde_json::to_vec_pretty(&manifest).map_err(|e| unreadable(e.into()))?;
    let mut archive = Archive::default();
    let (length, hash) = (text.len() as u64, blake3::hash(&text).to_hex().to_string());
    let mut add = |name: &str, source, bytes| {
        archive.add(&format!("{id}/{name}"), source, bytes).map_err(unreadable)
    };
    add(MODEL_MANIFEST_FILE, Source::Bytes(text.into()), length)?;
    for (name, source) in sources {
        add(&name, source, manifest.files.get(&name).map_or(0, |file| file.bytes))?;
    }
    respond_with_archive(archive, id, &hash, &headers).await
}

/// Imports a model from a tar archive of `GET /models/{id}/archive`.
///
/// Sizes and hashes of all files are verified, and a policy is loaded.
#[utoipa::path(
    post, path = "/models", tag = "models",
    request_body(content = schemas::Bytes, content_type = "application/octet-stream", description = "Tar archive without compression"),
    responses((status = 201, description = "The new model", body = schemas::Model), (status = 200, description = "The model already exists", body = schemas::Model)),
)]
pub(crate) async fn import(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    request: Request,
) -> Result<Response, Problem> {
    let received = receive(&state, &scheduler.uploads_dir(), MODEL_MANIFEST_FILE, request).await?;
    let verified = tokio::task::spawn_blocking(move || {
        let manifest = ModelManifest::verify(&received.root, &received.paths);
        (manifest, received)
    });
    let verified = verified.await;
    let (manifest, received): (_, Received) =
        verified.map_err(|error| Problem::file_unreadable(&io::Error::other(error)))?;
    let manifest = manifest.map_err(Problem::invalid_archive)?;
    let known = scheduler.store.record(RecordKind::Model, &manifest.model_id()).await?;
    let is_known = known.is_some();
    let record = match known {
        Some(record) => record,
        None => scheduler.import_model(&received.root, &manifest).await?,
    };
    let location = format!("/api/v1/models/{}", record["id"].as_str().unwrap_or_default());
    let body = Json(with_file_urls(record));
    Ok(match is_known {
        true => body.into_response(),
        false => (StatusCode::CREATED, [(header::LOCATION, location)], body).into_response(),
    })
}
