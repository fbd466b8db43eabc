//! Models: the list, the card, and the files that the page fetches.

use crate::model::{Model, ModelFile};
use crate::{AppState, Problem};
use axum::Json;
use axum::body::Body;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use tower::ServiceExt;
use tower_http::services::ServeFile;

/// All models that have weights, by id.
pub(crate) async fn list(State(state): State<AppState>) -> Result<Json<Value>, Problem> {
    let mut data = Vec::new();
    for model in Model::all(&state).await? {
        data.push(model.describe(&state).await?);
    }
    Ok(Json(json!({ "object": "list", "data": data, "has_more": false })))
}

/// One model.
pub(crate) async fn card(
    State(state): State<AppState>,
    model: Model,
) -> Result<Json<Value>, Problem> {
    Ok(Json(model.describe(&state).await?))
}

/// One file of a model. Its ETag is its BLAKE3; an address that names the hash never changes its
/// content and may be kept for ever, any other is checked each time.
pub(crate) async fn file(
    State(state): State<AppState>,
    model: Model,
    Path((_, name)): Path<(String, String)>,
    mut request: Request,
) -> Result<Response, Problem> {
    let file = ModelFile::named(&name).ok_or_else(|| no_file(&model, &name))?;
    let hashed = state.hashed(model.path(file)).await.map_err(|e| Problem::unreadable(&e))?;
    let hash = hashed.ok_or_else(|| no_file(&model, &name))?.blake3.to_hex();

    let asked = request.uri().query().and_then(|query| query.strip_prefix("blake3="));
    let cache = match asked {
        Some(asked) if asked == hash.as_str() => "public, max-age=31536000, immutable",
        Some(_) => return Err(other_content(&model, &hash)),
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

fn no_file(model: &Model, name: &str) -> Problem {
    let known = ModelFile::ALL.map(|file| file.name).join(", ");
    Problem {
        status: StatusCode::NOT_FOUND,
        code: "model_file_not_found",
        detail: format!("model \"{}\" has no file \"{name}\"", model.id),
        hint: format!("the files of a model are {known}; its card lists those that it has"),
    }
}

fn other_content(model: &Model, hash: &str) -> Problem {
    Problem {
        status: StatusCode::NOT_FOUND,
        code: "model_changed",
        detail: format!("model \"{}\" no longer has the content that was asked for", model.id),
        hint: format!("its file now has the hash {hash}; read the card again"),
    }
}

fn out_of_range(file: ModelFile, refused: &Response) -> Response {
    let problem = Problem {
        status: StatusCode::RANGE_NOT_SATISFIABLE,
        code: "range_not_satisfiable",
        detail: format!("{} does not have the bytes that were asked for", file.file_name),
        hint: "the Content-Range header gives the length".into(),
    };
    let length = refused.headers().get(header::CONTENT_RANGE).cloned();
    let mut response = problem.into_response();
    if let Some(length) = length {
        response.headers_mut().insert(header::CONTENT_RANGE, length);
    }
    response
}
