//! Models: the list, the card, and the files that the page fetches.

use super::content::{CHECKED, Content, KEPT, part_of};
use super::list::Page;
use super::{Jobs, answers, artifacts};
use crate::extract::{Path, Query};
use crate::model::{Model, ModelFile, OF_JOB};
use crate::state::{DEFAULT, Hashed};
use crate::store::RecordKind;
use crate::{AppState, Code, Problem};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::Response;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// All models that have weights: those that were there before by id, then those of jobs, newest first.
#[utoipa::path(
    get, path = "/models", tag = "models",
    params(
        ("after" = Option<String>, Query, description = "Id of the last model of the page before: one of a job"),
        ("limit" = Option<i64>, Query, minimum = 1, maximum = 1000, description = "Models of jobs"),
    ),
    responses((status = 200, description = "Models with their files and cards", body = Page<answers::Model>)),
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
    responses((status = 200, description = "Its files and card", body = answers::Model)),
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
    responses(
        (status = 200, description = "The file", content((answers::Bytes = "application/octet-stream"), (Value = "application/json"))),
        (status = 206, description = "A part of it", content_type = "*/*", body = answers::Bytes),
        (status = 304, description = "It is as If-None-Match says"),
    ),
)]
pub(crate) async fn file(
    State(state): State<AppState>,
    Path((id, name)): Path<(String, String)>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let id = state.model_of(&id);
    let asked = uri.query().and_then(|query| query.strip_prefix("blake3="));
    let cache = |hash: &str| match asked {
        Some(asked) if asked == hash => Ok(KEPT),
        Some(_) => Err(other_content(id, hash)),
        // `default` may be another one tomorrow.
        None => Ok(CHECKED),
    };
    let missing = || no_file(id, &name);
    if let (Some(record), Some(engine)) = (of_job(&state, id).await?, &state.engine) {
        let known = ModelFile::named(&name).and_then(|file| record["files"].get(file.file_name));
        let hash = known.and_then(|file| file["blake3"].as_str()).ok_or_else(missing)?;
        return artifacts::serve(engine, hash, cache(hash)?, &headers).await;
    }
    let model = Model::find(&state, id).await?;
    let file = ModelFile::named(&name).ok_or_else(missing)?;
    let path = model.path(file);
    let hashed = state.hashed(vec![path.clone()]).await.map_err(|e| Problem::unreadable(&e))?;
    let Hashed { blake3, bytes, .. } = hashed.ok_or_else(missing)?;
    let hash = blake3.to_hex();
    let content = Content {
        name: file.file_name,
        hash: Some(&hash),
        bytes,
        content_type: file.content_type,
        cache: cache(&hash)?,
    };
    let part = async |part| {
        let body = part_of(&path, part).await;
        // Another file may have taken its place before it was opened.
        let now = state.hashed(vec![path.clone()]).await;
        match now.map_err(|e| Problem::unreadable(&e))? {
            Some(now) if now.blake3 == blake3 => body.map_err(|e| Problem::unreadable(&e)),
            Some(now) => Err(other_content(id, &now.blake3.to_hex())),
            None => Err(missing()),
        }
    };
    content.answer(&headers, part).await
}

fn no_file(id: &str, name: &str) -> Problem {
    let known = ModelFile::ALL.map(|file| file.name).join(", ");
    Problem {
        status: StatusCode::NOT_FOUND,
        code: Code::ModelFileNotFound,
        detail: format!("model \"{id}\" has no file \"{name}\""),
        hint: format!("the files of a model are {known}; its card lists those that it has"),
        param: None,
    }
}

fn other_content(id: &str, hash: &str) -> Problem {
    Problem {
        status: StatusCode::NOT_FOUND,
        code: Code::ModelChanged,
        detail: format!("model \"{id}\" no longer has the content that was asked for"),
        hint: format!("its file now has the hash {hash}; read the card again"),
        param: None,
    }
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
