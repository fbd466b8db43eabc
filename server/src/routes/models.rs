//! Models: the list, the card, and the files that the page fetches.

use super::{Jobs, artifacts};
use crate::extract::{Path, Query};
use crate::model::{Model, ModelFile, OF_JOB};
use crate::state::DEFAULT;
use crate::store::RecordKind;
use crate::{AppState, Problem};
use axum::Json;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use tower::ServiceExt;
use tower_http::services::ServeFile;

/// All models that have weights: those that were there before by id, then those of jobs, newest first.
#[utoipa::path(
    get, path = "/models", tag = "models",
    params(
        ("after" = Option<String>, Query, description = "Id of the last model of the page before: one of a job"),
        ("limit" = Option<i64>, Query, minimum = 1, maximum = 1000, description = "Models of jobs"),
    ),
    responses((status = 200, description = "Models with their files and cards", body = Page<Object>)),
)]
pub(crate) async fn list(
    State(state): State<AppState>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Json<Value>, Problem> {
    let limit = query.get("limit").map_or(Ok(MOST_OF_JOBS), |text| {
        let limit = text.parse().ok().filter(|limit| (1..=MOST_OF_JOBS).contains(limit));
        let bounds = || format!("it is a number from 1 to {MOST_OF_JOBS}");
        limit.ok_or_else(|| Problem::invalid("limit", bounds()))
    })?;
    let after = query.get("after");
    let (mut data, mut has_more) = (Vec::new(), false);
    if after.is_none() {
        for model in Model::all(&state).await? {
            data.push(model.describe(&state).await?);
        }
    }
    if let Some(engine) = &state.engine {
        let records;
        (records, has_more) = super::list::page(engine, RecordKind::Model, after, limit).await?;
        data.extend(records.into_iter().map(described));
    }
    Ok(Json(json!({ "object": "list", "data": data, "has_more": has_more })))
}

/// Models of jobs in a list at most.
const MOST_OF_JOBS: i64 = 1000;

/// The record of a job's model, if it is one.
async fn of_job(state: &AppState, id: &str) -> Result<Option<Value>, Problem> {
    let Some(engine) = state.engine.as_ref().filter(|_| id.starts_with(OF_JOB)) else {
        return Ok(None);
    };
    Ok(engine.store.record(RecordKind::Model, id).await?)
}

/// The record of a job's model with the addresses of its files, each under the name that the files of all models have.
fn described(mut record: Value) -> Value {
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

/// One model, with what evaluations counted of it.
#[utoipa::path(
    get, path = "/models/{id}", tag = "models", params(("id" = String, Path)),
    responses((status = 200, description = "Its files and card", body = Object)),
)]
pub(crate) async fn card(
    State(state): State<AppState>,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    let id = state.model_of(&id);
    let (mut told, hash) = match of_job(&state, id).await? {
        // Its id is made of its files.
        Some(record) => (described(record), None),
        None => {
            let model = Model::find(&state, id).await?;
            (model.describe(&state).await?, model.hash(&state).await?)
        }
    };
    if let Some(engine) = &state.engine {
        let mut evaluations = engine.store.evaluations_of(id).await?;
        evaluations.retain(|evaluation| hash.as_ref().is_none_or(|hash| is_of(evaluation, hash)));
        told["evaluations"] = evaluations.into();
    }
    Ok(Json(told))
}

/// Whether an evaluation is of the files with this hash, and not of others that lay in their folder before.
fn is_of(evaluation: &Value, hash: &str) -> bool {
    let reports = evaluation["reports"].as_array().into_iter().flatten();
    reports.filter_map(|report| report["model_hash"].as_str()).all(|of| of == hash)
}

/// Forgets a model that a job made, with those of its files that no other model has.
#[utoipa::path(
    delete, path = "/models/{id}", tag = "models", params(("id" = String, Path)),
    responses((status = 204, description = "It is forgotten")),
)]
pub(crate) async fn delete(
    State(state): State<AppState>,
    Jobs(engine): Jobs,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    let Some(record) = of_job(&state, &id).await? else {
        let model = Model::find(&state, &id).await?;
        return Err(Problem::not_of_a_job(&model.id));
    };
    if state.model_of(DEFAULT) == id {
        return Err(Problem::not_of_a_job(DEFAULT));
    }
    engine.not_in_use(&id).await?;
    engine.forget_model(&record).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// One file of a model. Its ETag is its BLAKE3; an address that names the hash never changes its
/// content and may be kept for ever, any other is checked each time.
#[utoipa::path(
    get, path = "/models/{id}/{file}", tag = "models",
    params(("id" = String, Path), ("file" = String, Path, description = "weights, starts or config"), ("blake3" = Option<String>, Query, description = "The hash that it must have")),
    responses((status = 200, description = "The file", content_type = "application/octet-stream", body = Vec<u8>), (status = 206, description = "A part of it", content_type = "application/octet-stream", body = Vec<u8>)),
)]
pub(crate) async fn file(
    State(state): State<AppState>,
    Path((id, name)): Path<(String, String)>,
    mut request: Request,
) -> Result<Response, Problem> {
    let id = state.model_of(&id);
    if let (Some(record), Some(engine)) = (of_job(&state, id).await?, &state.engine) {
        let known = ModelFile::named(&name).and_then(|file| record["files"].get(file.file_name));
        let hash = known.and_then(|file| file["blake3"].as_str());
        let hash = hash.ok_or_else(|| no_file(id, &name))?;
        let asked = request.uri().query().and_then(|query| query.strip_prefix("blake3="));
        if asked.is_some_and(|asked| asked != hash) {
            return Err(other_content(id, hash));
        }
        let is_fixed = asked.is_some();
        let mut answer = artifacts::serve(engine, hash, request.headers()).await?;
        if !is_fixed {
            // `default` may be another one tomorrow.
            let cache = HeaderValue::from_static("no-cache");
            answer.headers_mut().insert(header::CACHE_CONTROL, cache);
        }
        return Ok(answer);
    }
    let model = Model::find(&state, id).await?;
    let file = ModelFile::named(&name).ok_or_else(|| no_file(&model.id, &name))?;
    let hashed = state.hashed(vec![model.path(file)]).await.map_err(|e| Problem::unreadable(&e))?;
    let hash = hashed.ok_or_else(|| no_file(&model.id, &name))?.blake3.to_hex();

    let asked = request.uri().query().and_then(|query| query.strip_prefix("blake3="));
    let cache = match asked {
        Some(asked) if asked == hash.as_str() => "public, max-age=31536000, immutable",
        Some(_) => return Err(other_content(&model.id, &hash)),
        None => "no-cache",
    };
    let etag = format!("\"{hash}\"");
    if names(request.headers(), header::IF_NONE_MATCH, &etag) {
        let headers = [(header::ETAG, etag.as_str()), (header::CACHE_CONTROL, cache)];
        return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
    }

    // The file service knows times of change, not hashes: conditions were answered above.
    let headers = request.headers_mut();
    if headers.contains_key(header::IF_RANGE) && !names(headers, header::IF_RANGE, &etag) {
        headers.remove(header::RANGE);
    }
    for condition in [
        header::IF_MATCH,
        header::IF_NONE_MATCH,
        header::IF_MODIFIED_SINCE,
        header::IF_UNMODIFIED_SINCE,
    ] {
        headers.remove(condition);
    }
    let mut response = match ServeFile::new(model.path(file)).oneshot(request).await {
        Ok(response) => response.map(Body::new),
        Err(never) => match never {},
    };
    if response.status() == StatusCode::RANGE_NOT_SATISFIABLE {
        return Ok(out_of_range(file, &response));
    }
    response.headers_mut().remove(header::LAST_MODIFIED);
    let headers = [
        (header::ETAG, etag.as_str()),
        (header::CACHE_CONTROL, cache),
        (header::CONTENT_TYPE, file.content_type),
    ];
    Ok((headers, response).into_response())
}

/// Does this header name the tag, alone or in a list, or any (`*`)?
fn names(headers: &HeaderMap, header: header::HeaderName, etag: &str) -> bool {
    let values = headers.get_all(header);
    let mut tags = values.iter().filter_map(|v| v.to_str().ok()).flat_map(|v| v.split(','));
    tags.any(|tag| tag.trim() == "*" || tag.trim().trim_start_matches("W/") == etag)
}

fn no_file(id: &str, name: &str) -> Problem {
    let known = ModelFile::ALL.map(|file| file.name).join(", ");
    Problem {
        status: StatusCode::NOT_FOUND,
        code: "model_file_not_found",
        detail: format!("model \"{id}\" has no file \"{name}\""),
        hint: format!("the files of a model are {known}; its card lists those that it has"),
        param: None,
    }
}

fn other_content(id: &str, hash: &str) -> Problem {
    Problem {
        status: StatusCode::NOT_FOUND,
        code: "model_changed",
        detail: format!("model \"{id}\" no longer has the content that was asked for"),
        hint: format!("its file now has the hash {hash}; read the card again"),
        param: None,
    }
}

fn out_of_range(file: ModelFile, refused: &Response) -> Response {
    let problem = Problem {
        status: StatusCode::RANGE_NOT_SATISFIABLE,
        code: "range_not_satisfiable",
        detail: format!("{} does not have the bytes that were asked for", file.file_name),
        hint: "the Content-Range header gives the length".into(),
        param: None,
    };
    let length = refused.headers().get(header::CONTENT_RANGE).cloned();
    let mut response = problem.into_response();
    if let Some(length) = length {
        response.headers_mut().insert(header::CONTENT_RANGE, length);
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_counted_of_other_files_is_left_out() {
        let of =
            |hash: Value| json!({ "reports": [{ "model_hash": "ab" }, { "model_hash": hash }] });
        assert!(is_of(&of("ab".into()), "ab"));
        assert!(!is_of(&of("cd".into()), "ab"));
        // The planner acts without files.
        assert!(is_of(&of(Value::Null), "ab"));
    }
}
