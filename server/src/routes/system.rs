//! Health, version, metrics and API index.

use super::meshes::MAX_MESH_BYTES;
use super::prometheus_text::{OPEN_METRICS, PROMETHEUS, accepts_open_metrics, from_open_metrics};
use super::schemas;
use crate::archive::MAX_ARCHIVE_BYTES;
use crate::extract::MAX_BODY;
use crate::{AppState, Problem};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use mesh::MAX_TRIANGLES;
use serde_json::{Value, json};

/// Prometheus metrics.
#[utoipa::path(
    get, path = "/metrics", tag = "system",
    responses((
        status = 200, description = "Metrics as text: OpenMetrics if `Accept` names it",
        content((String = "text/plain"), (String = "application/openmetrics-text")),
    )),
)]
pub(super) async fn metrics(
    State(state): State<AppState>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let jobs = match &state.scheduler {
        Some(scheduler) => scheduler.store.counts().await?,
        None => Vec::new(),
    };
    let text = state.metrics.render(jobs);
    let accept = headers.get(header::ACCEPT).and_then(|value| value.to_str().ok());
    let (content_type, text) = match accepts_open_metrics(accept.unwrap_or_default()) {
        true => (OPEN_METRICS, text),
        false => (PROMETHEUS, from_open_metrics(&text)),
    };
    Ok(([(header::CONTENT_TYPE, content_type), (header::VARY, "accept")], text).into_response())
}

/// Liveness probe.
#[utoipa::path(
    get, path = "/healthz", tag = "system",
    responses((status = 200, description = "The process responds", body = schemas::Health)),
)]
pub(super) async fn health() -> Json<Value> {
    Json(json!({ "status": "ok" }))
}

/// Name and version of the server.
#[utoipa::path(
    get, path = "/version", tag = "system",
    responses((status = 200, description = "Name and version", body = schemas::Version)),
)]
pub(super) async fn version() -> Json<Value> {
    Json(json!({ "name": "ngf-grasp", "version": env!("CARGO_PKG_VERSION") }))
}

/// Readiness probe: 200 if the database can be written.
#[utoipa::path(
    get, path = "/readyz", tag = "system",
    responses((status = 200, description = "The server is ready", body = schemas::Health)),
)]
pub(super) async fn ready(State(state): State<AppState>) -> Response {
    let is_ready = match &state.scheduler {
        Some(scheduler) => scheduler.is_ready().await,
        None => true,
    };
    match is_ready {
        true => Json(json!({ "status": "ready" })).into_response(),
        false => Problem::not_ready().into_response(),
    }
}

/// API index: URLs of resources, and limits.
#[utoipa::path(
    get, path = "/api/v1", tag = "system",
    responses((status = 200, description = "URLs and limits", body = schemas::ApiIndex)),
)]
pub(super) async fn index(State(state): State<AppState>) -> Json<Value> {
    let url = |suffix: &str| format!("/api/v1/{suffix}");
    Json(json!({
        "object": "api", "version": env!("CARGO_PKG_VERSION"),
        "jobs_enabled": state.scheduler.is_some(),
        "jobs_ready": state.scheduler.as_ref().is_some_and(|scheduler| scheduler.has_worker()),
        "urls": {
            "jobs": url("jobs"), "stream": url("stream?jobs="), "models": url("models"),
            "datasets": url("datasets"), "meshes": url("meshes"), "artifacts": url("artifacts/{hash}"),
        },
        "limits": {
            "request_bytes": MAX_BODY, "mesh_bytes": MAX_MESH_BYTES, "mesh_triangles": MAX_TRIANGLES,
            "archive_bytes": MAX_ARCHIVE_BYTES,
            "total_mesh_bytes": state.quotas.max_total_mesh_bytes, "queued_jobs": state.quotas.max_queued,
            "writes_per_second": state.quotas.max_writes_per_second,
        },
    }))
}
