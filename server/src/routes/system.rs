//! Health, version, metrics, OpenAPI description and API index.

use super::meshes::MAX_MESH_BYTES;
use super::prometheus_text::{OPEN_METRICS, PROMETHEUS, accepts_open_metrics, from_open_metrics};
use super::schemas;
use crate::extract::MAX_BODY;
use crate::{AppState, Problem, ProblemCode};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use mesh::MAX_TRIANGLES;
use serde_json::{Value, json};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityScheme};
use utoipa::openapi::{
    Components, ContentBuilder, InfoBuilder, LicenseBuilder, OpenApi, Ref, RefOr,
    Response as Answer, ResponseBuilder, SecurityRequirement,
};
use utoipa::{PartialSchema, ToSchema};

/// Error response (RFC 9457).
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct ProblemDetails {
    /// Problem type: always `about:blank`.
    r#type: String,
    /// Phrase of the HTTP status.
    title: String,
    status: u16,
    /// Cause of the error.
    detail: String,
    /// Stable code of the error.
    code: ProblemCode,
    /// Suggested remedy.
    hint: String,
    /// Invalid parameters.
    errors: Option<Vec<ParameterError>>,
    /// Id of this request in the server log.
    request_id: Option<String>,
}

/// Error of one parameter.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct ParameterError {
    param: String,
    detail: String,
}

/// Adds the parts of the description that all endpoints share: error responses and the token scheme.
pub(super) fn with_common_responses(mut api: OpenApi) -> OpenApi {
    api.info = InfoBuilder::new()
        .title("ngf-grasp")
        .version(env!("CARGO_PKG_VERSION"))
        .description(Some(
            "Dataset generation, training and evaluation of grasping policies as jobs.",
        ))
        .license(Some(LicenseBuilder::new().name("MIT OR Apache-2.0").build()))
        .build();
    let components = api.components.get_or_insert_with(Components::new);
    components.schemas.insert("Problem".into(), ProblemDetails::schema());
    components.schemas.insert("ProblemCode".into(), ProblemCode::schema());
    components.schemas.insert("ParameterError".into(), ParameterError::schema());
    let bearer = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).build();
    components.add_security_scheme("token", SecurityScheme::Http(bearer));
    for item in api.paths.paths.values_mut() {
        let writes = [&mut item.post, &mut item.patch, &mut item.delete, &mut item.put];
        for operation in writes.into_iter().flatten() {
            // The token is optional, because not every server requires one.
            let none = SecurityRequirement::default();
            let token = SecurityRequirement::new::<_, [&str; 0], _>("token", []);
            operation.security = Some(vec![none, token]);
        }
        let all = [&mut item.get, &mut item.post, &mut item.patch, &mut item.delete, &mut item.put];
        for operation in all.into_iter().flatten() {
            operation.responses.responses.insert("default".into(), RefOr::T(problem()));
        }
    }
    api
}

/// Common error response.
fn problem() -> Answer {
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    ResponseBuilder::new()
        .description("Error: cause and suggested remedy")
        .content("application/problem+json", content)
        .build()
}

/// OpenAPI description.
#[utoipa::path(
    get, path = "/openapi.json", tag = "system",
    responses((status = 200, description = "This description", body = Object)),
)]
pub(super) async fn openapi() -> Json<OpenApi> {
    Json(crate::openapi())
}

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
        "urls": {
            "jobs": url("jobs"), "stream": url("stream?jobs="), "models": url("models"),
            "datasets": url("datasets"), "meshes": url("meshes"), "artifacts": url("artifacts/{hash}"),
        },
        "limits": {
            "request_bytes": MAX_BODY, "mesh_bytes": MAX_MESH_BYTES, "mesh_triangles": MAX_TRIANGLES,
            "total_mesh_bytes": state.quotas.max_total_mesh_bytes, "queued_jobs": state.quotas.max_queued,
            "writes_per_second": state.quotas.max_writes_per_second,
        },
    }))
}
