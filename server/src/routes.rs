//! Which path leads where.

mod artifacts;
mod datasets;
mod events;
mod jobs;
mod meshes;
mod models;
mod operation;
mod page;

use crate::engine::Engine;
use crate::extract::MOST_BODY;
use crate::{AppState, Problem};
use axum::extract::{DefaultBodyLimit, FromRequestParts};
use axum::http::request::Parts;
use axum::http::{Method, Uri};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get};
use axum::{Json, Router};
use geometry::mesh::{MAX_BYTES, MAX_TRIANGLES};
use serde_json::{Value, json};
use std::sync::Arc;
use utoipa::openapi::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// All routes, and their description.
pub(crate) fn router() -> (Router<AppState>, OpenApi) {
    let short = OpenApiRouter::new()
        .routes(routes!(jobs::list, jobs::create))
        .routes(routes!(jobs::get, jobs::patch, jobs::delete))
        .routes(routes!(jobs::report))
        .routes(routes!(events::list))
        .routes(routes!(events::stream_of))
        .routes(routes!(events::metrics))
        .routes(routes!(jobs::logs))
        .routes(routes!(jobs::checkpoints))
        .routes(routes!(jobs::artifacts))
        .routes(routes!(jobs::act))
        .routes(routes!(events::stream_all))
        .routes(routes!(artifacts::get))
        .routes(routes!(datasets::list))
        .routes(routes!(datasets::get))
        .routes(routes!(datasets::episodes))
        .routes(routes!(datasets::episode))
        .layer(DefaultBodyLimit::max(MOST_BODY));
    // An upload has bounds of its own; those of the extractor for forms are narrower.
    let meshes = OpenApiRouter::new()
        .routes(routes!(meshes::list, meshes::upload))
        .routes(routes!(meshes::get, meshes::delete))
        .routes(routes!(meshes::file))
        .layer(DefaultBodyLimit::disable());
    let v1 = OpenApiRouter::new()
        .routes(routes!(models::list))
        .routes(routes!(models::card))
        .routes(routes!(models::file))
        .merge(short)
        .merge(meshes);
    let (v1, api) = OpenApiRouter::new().nest("/api/v1", v1).split_for_parts();
    let router = Router::new()
        .route("/healthz", get(health))
        .route("/readyz", get(ready))
        .route("/version", get(version))
        .route("/metrics", get(operation::metrics))
        .route("/openapi.json", get(operation::openapi))
        .route("/api/v1", get(discover))
        .route("/api/{*rest}", any(not_found))
        .merge(v1)
        .fallback(page::file)
        .method_not_allowed_fallback(method_not_allowed);
    (router, operation::described(api))
}

/// The engine of a server that does jobs.
pub(crate) struct Jobs(pub(crate) Arc<Engine>);

impl FromRequestParts<AppState> for Jobs {
    type Rejection = Problem;

    async fn from_request_parts(_: &mut Parts, state: &AppState) -> Result<Self, Problem> {
        state.engine.clone().map(Self).ok_or_else(Problem::no_jobs)
    }
}

/// Answers as long as the process can.
async fn health() -> Json<Value> {
    Json(json!({ "status": "ok" }))
}

/// Which program this is.
async fn version() -> Json<Value> {
    Json(json!({ "name": "ngf-grasp", "version": env!("CARGO_PKG_VERSION") }))
}

/// Answers with 200 once requests can be served.
async fn ready(axum::extract::State(state): axum::extract::State<AppState>) -> Response {
    let is_ready = match &state.engine {
        Some(engine) => engine.store.is_ready().await,
        None => true,
    };
    match is_ready {
        true => Json(json!({ "status": "ready" })).into_response(),
        false => Problem::not_ready().into_response(),
    }
}

/// What there is, and its bounds.
async fn discover(axum::extract::State(state): axum::extract::State<AppState>) -> Json<Value> {
    let url = |rest: &str| format!("/api/v1/{rest}");
    Json(json!({
        "object": "api", "version": env!("CARGO_PKG_VERSION"),
        "jobs_enabled": state.engine.is_some(),
        "urls": {
            "jobs": url("jobs"), "stream": url("stream?jobs="), "models": url("models"),
            "datasets": url("datasets"), "meshes": url("meshes"), "artifacts": url("artifacts"),
        },
        "limits": {
            "request_bytes": MOST_BODY, "mesh_bytes": MAX_BYTES, "mesh_triangles": MAX_TRIANGLES,
            "kept_mesh_bytes": state.limits.kept_mesh_bytes, "queued_jobs": state.limits.queued,
            "changes_per_second": state.limits.changes_per_second,
        },
    }))
}

async fn not_found(uri: Uri) -> Problem {
    Problem::not_found(uri.path())
}

async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    Problem::method_not_allowed(method.as_str(), uri.path())
}
