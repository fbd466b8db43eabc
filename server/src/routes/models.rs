//! Models: list, details and files.

use super::http_content::{Content, IMMUTABLE, REVALIDATE, read_range};
use super::pagination::Page;
use super::{RequireScheduler, artifacts, schemas};
use crate::extract::{Parameters, Path};
use crate::model::{BuiltInModel, JOB_MODEL_PREFIX, ModelFile};
use crate::state::{DEFAULT_MODEL_ID, FileHash};
use crate::store::RecordKind;
use crate::{AppState, Problem, ProblemCode};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::Response;
use serde_json::{Value, json};

/// Lists the models: the built-in ones by id, then trained ones, newest first.
#[utoipa::path(
    get, path = "/models", tag = "models",
    params(
        ("after" = Option<String>, Query, description = "Id of the last model of the previous page; must be a trained model"),
        ("limit" = Option<i64>, Query, minimum = 1, maximum = 1000, description = "Maximum number of trained models"),
    ),
    responses((status = 200, description = "Models with their files and cards", body = Page<schemas::Model>)),
)]
pub(crate) async fn list(
    State(state): State<AppState>,
    parameters: Parameters,
) -> Result<Json<Value>, Problem> {
    let query = parameters.only(&["after", "limit"])?;
    let limit = query.get("limit").map_or(Ok(MAX_JOB_MODELS), |text| {
        let limit = text.parse().ok().filter(|limit| (1..=MAX_JOB_MODELS).contains(limit));
        let bounds = || format!("must be a number from 1 to {MAX_JOB_MODELS}");
        limit.ok_or_else(|| Problem::invalid_parameter("limit", bounds()))
    })?;
    let after = query.get("after");
    let (mut data, mut has_more) = (Vec::new(), false);
    if after.is_none() {
        for model in BuiltInModel::all(&state).await? {
            data.push(model.describe(&state).await?);
        }
    }
    if let Some(scheduler) = &state.scheduler {
        let records;
        (records, has_more) =
            super::pagination::page_of_records(scheduler, RecordKind::Model, after, limit).await?;
        data.extend(records.into_iter().map(with_file_urls));
    }
    Ok(Json(json!({ "object": "list", "data": data, "has_more": has_more })))
}

/// Maximum number of trained models per page.
const MAX_JOB_MODELS: i64 = 1000;

/// Record of a trained model; `None` if the id is not one of a trained model.
pub(super) async fn job_model(state: &AppState, id: &str) -> Result<Option<Value>, Problem> {
    let Some(scheduler) = state.scheduler.as_ref().filter(|_| id.starts_with(JOB_MODEL_PREFIX))
    else {
        return Ok(None);
    };
    Ok(scheduler.store.record(RecordKind::Model, id).await?)
}

/// Adds URLs to the files of a trained model, and names the files as those of built-in models.
pub(super) fn with_file_urls(mut record: Value) -> Value {
    let id = record["id"].as_str().unwrap_or_default().to_owned();
    let Some(files) = record["files"].as_object_mut() else { return record };
    let named = std::mem::take(files).into_iter().map(|(file_name, mut file)| {
        let known = ModelFile::ALL.iter().find(|known| known.file_name == file_name);
        let name = known.map_or(file_name, |known| known.name.to_owned());
        let hash = file["blake3"].as_str().unwrap_or_default();
        file["url"] = match known {
            Some(_) => format!("/api/v1/models/{id}/{name}?blake3={hash}").into(),
            None => format!("/api/v1/artifacts/{hash}").into(),
        };
        (name, file)
    });
    *files = named.collect();
    record
}

/// Returns a model with its evaluations.
#[utoipa::path(
    get, path = "/models/{id}", tag = "models", params(("id" = String, Path)),
    responses((status = 200, description = "Files, card and evaluations", body = schemas::Model)),
)]
pub(crate) async fn get(
    State(state): State<AppState>,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    let id = state.resolve_model_id(&id);
    let (mut json, hash) = match job_model(&state, id).await? {
        // The id is derived from the files, so evaluations by id always refer to these files.
        Some(record) => (with_file_urls(record), None),
        None => {
            let model = BuiltInModel::find(&state, id).await?;
            (model.describe(&state).await?, model.hash(&state).await?)
        }
    };
    if let Some(scheduler) = &state.scheduler {
        let mut evaluations = scheduler.store.evaluations_of(id).await?;
        evaluations.retain(|evaluation| {
            hash.as_ref().is_none_or(|hash| evaluates_files(evaluation, hash))
        });
        json["evaluations"] = evaluations.into();
    }
    Ok(Json(json))
}

/// Whether an evaluation refers to the files with this hash, not to earlier contents of the folder.
fn evaluates_files(evaluation: &Value, hash: &str) -> bool {
    let reports = evaluation["reports"].as_array().into_iter().flatten();
    reports.filter_map(|report| report["model_hash"].as_str()).all(|of| of == hash)
}

/// Deletes a trained model, and its files that no other model uses.
#[utoipa::path(
    delete, path = "/models/{id}", tag = "models", params(("id" = String, Path)),
    responses((status = 204, description = "The model is deleted")),
)]
pub(crate) async fn delete(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    let Some(record) = job_model(&state, &id).await? else {
        let model = BuiltInModel::find(&state, &id).await?;
        return Err(Problem::model_read_only(&model.id));
    };
    if state.resolve_model_id(DEFAULT_MODEL_ID) == id {
        return Err(Problem::model_read_only(DEFAULT_MODEL_ID));
    }
    scheduler.ensure_unused(&id).await?;
    scheduler.delete_model(&record).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Downloads a file of a model.
///
/// The ETag is the BLAKE3. A URL with the hash is immutable; other URLs are revalidated.
#[utoipa::path(
    get, path = "/models/{id}/{file}", tag = "models",
    params(("id" = String, Path), ("file" = String, Path, description = "weights, start_configurations or config"), ("blake3" = Option<String>, Query, description = "Required BLAKE3 (hex) of the file")),
    responses(
        (status = 200, description = "The file", content((schemas::Bytes = "application/octet-stream"), (Value = "application/json"))),
        (status = 206, description = "The requested range", content((schemas::Bytes = "application/octet-stream"), (schemas::Bytes = "*/*"))),
        (status = 304, description = "Not modified"),
    ),
)]
pub(crate) async fn file(
    State(state): State<AppState>,
    Path((id, name)): Path<(String, String)>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let id = state.resolve_model_id(&id);
    let required = uri.query().and_then(|query| query.strip_prefix("blake3="));
    let cache = |hash: &str| match required {
        Some(required) if required == hash => Ok(IMMUTABLE),
        Some(_) => Err(model_changed(id, hash)),
        // The contents behind `default` can change.
        None => Ok(REVALIDATE),
    };
    let missing = || model_file_not_found(id, &name);
    if let (Some(record), Some(scheduler)) = (job_model(&state, id).await?, &state.scheduler) {
        let known =
            ModelFile::from_name(&name).and_then(|file| record["files"].get(file.file_name));
        let hash = known.and_then(|file| file["blake3"].as_str()).ok_or_else(missing)?;
        return artifacts::serve(scheduler, hash, cache(hash)?, &headers).await;
    }
    let model = BuiltInModel::find(&state, id).await?;
    let file = ModelFile::from_name(&name).ok_or_else(missing)?;
    let path = model.path(file);
    let hashed = state.file_hash(path.clone()).await.map_err(|e| Problem::file_unreadable(&e))?;
    let FileHash { blake3, bytes, .. } = hashed.ok_or_else(missing)?;
    let hash = blake3.to_hex();
    let content = Content {
        name: file.file_name,
        hash: Some(&hash),
        bytes,
        content_type: file.content_type,
        cache: cache(&hash)?,
    };
    let body = async |range| {
        let body = read_range(&path, range).await;
        // The file may have been replaced before it was opened.
        let now = state.file_hash(path.clone()).await;
        match now.map_err(|e| Problem::file_unreadable(&e))? {
            Some(now) if now.blake3 == blake3 => body.map_err(|e| Problem::file_unreadable(&e)),
            Some(now) => Err(model_changed(id, &now.blake3.to_hex())),
            None => Err(missing()),
        }
    };
    content.respond(&headers, body).await
}

fn model_file_not_found(id: &str, name: &str) -> Problem {
    let known = ModelFile::ALL.map(|file| file.name).join(", ");
    Problem {
        status: StatusCode::NOT_FOUND,
        code: ProblemCode::ModelFileNotFound,
        detail: format!("model \"{id}\" has no file \"{name}\""),
        hint: format!("the files of a policy are {known}; GET the model for the available ones"),
        param: None,
    }
}

fn model_changed(id: &str, hash: &str) -> Problem {
    Problem {
        status: StatusCode::NOT_FOUND,
        code: ProblemCode::ModelChanged,
        detail: format!("model \"{id}\" no longer has the requested content"),
        hint: format!("the file now has the hash {hash}; GET the model again"),
        param: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evaluation_of_other_files_is_excluded() {
        let of =
            |hash: Value| json!({ "reports": [{ "model_hash": "ab" }, { "model_hash": hash }] });
        assert!(evaluates_files(&of("ab".into()), "ab"));
        assert!(!evaluates_files(&of("cd".into()), "ab"));
        // The planner has no model files.
        assert!(evaluates_files(&of(Value::Null), "ab"));
    }
}
