//! Which path leads where.

mod models;
mod page;

use crate::{AppState, Problem};
use axum::http::{Method, Uri};
use axum::routing::get;
use axum::{Json, Router};
use serde_json::{Value, json};

pub(crate) fn router() -> Router<AppState> {
    let v1 = Router::new()
        .route("/models", get(models::list))
        .route("/models/{id}", get(models::card))
        .route("/models/{id}/{file}", get(models::file));
    let api = Router::new().nest("/v1", v1).fallback(not_found);
    Router::new()
        .route("/healthz", get(health))
        .nest("/api", api)
        .fallback(page::file)
        .method_not_allowed_fallback(method_not_allowed)
}

/// Answers as long as the process can.
async fn health() -> Json<Value> {
    Json(json!({ "status": "ok" }))
}

async fn not_found(uri: Uri) -> Problem {
    Problem::not_found(uri.path())
}

async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    Problem::method_not_allowed(method.as_str(), uri.path())
}
