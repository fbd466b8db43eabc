//! For those who operate the server, and for programs that want to know it.

use super::answers;
use super::meshes::MOST_BYTES;
use crate::extract::MOST_BODY;
use crate::{AppState, Code, Problem};
use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use geometry::mesh::MAX_TRIANGLES;
use serde_json::{Value, json};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityScheme};
use utoipa::openapi::{
    Components, ContentBuilder, InfoBuilder, LicenseBuilder, OpenApi, Ref, RefOr,
    Response as Answer, ResponseBuilder, SecurityRequirement,
};
use utoipa::{PartialSchema, ToSchema};

/// How every error is told (RFC 9457).
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct ProblemDetails {
    /// Always `about:blank`.
    r#type: String,
    /// The status in words.
    title: String,
    status: u16,
    /// What happened to this request.
    detail: String,
    /// Which kind of problem.
    code: Code,
    /// What to do about it.
    hint: String,
    /// Which parameters are meant, where some are.
    errors: Option<Vec<WrongParameter>>,
    /// Names this request in the server's log.
    request_id: Option<String>,
}

/// What is wrong with a parameter.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct WrongParameter {
    param: String,
    detail: String,
}

/// Adds to the description what all requests have in common.
pub(super) fn described(mut api: OpenApi) -> OpenApi {
    api.info = InfoBuilder::new()
        .title("ngf-grasp")
        .version(env!("CARGO_PKG_VERSION"))
        .description(Some("Datasets, training, evaluation and weights as jobs."))
        .license(Some(LicenseBuilder::new().name("MIT OR Apache-2.0").build()))
        .build();
    let components = api.components.get_or_insert_with(Components::new);
    components.schemas.insert("Problem".into(), ProblemDetails::schema());
    components.schemas.insert("Code".into(), Code::schema());
    components.schemas.insert("WrongParameter".into(), WrongParameter::schema());
    let bearer = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).build();
    components.add_security_scheme("token", SecurityScheme::Http(bearer));
    for item in api.paths.paths.values_mut() {
        let changes = [&mut item.post, &mut item.patch, &mut item.delete, &mut item.put];
        for operation in changes.into_iter().flatten() {
            // With the token, where the server has one.
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

fn problem() -> Answer {
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    ResponseBuilder::new()
        .description("What went wrong, and what to do about it")
        .content("application/problem+json", content)
        .build()
}

/// The description of all requests.
#[utoipa::path(
    get, path = "/openapi.json", tag = "operation",
    responses((status = 200, description = "This description", body = Object)),
)]
pub(super) async fn openapi() -> Json<OpenApi> {
    Json(crate::openapi())
}

/// Numbers for Prometheus.
#[utoipa::path(
    get, path = "/metrics", tag = "operation",
    responses((status = 200, description = "Numbers as text", content_type = "application/openmetrics-text", body = String)),
)]
pub(super) async fn metrics(State(state): State<AppState>) -> Result<Response, Problem> {
    let jobs = match &state.engine {
        Some(engine) => engine.store.counts().await?,
        None => Vec::new(),
    };
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    Ok(([(header::CONTENT_TYPE, kind)], state.metrics.written(jobs)).into_response())
}

/// Answers as long as the process can.
#[utoipa::path(
    get, path = "/healthz", tag = "operation",
    responses((status = 200, description = "It answers", body = answers::Health)),
)]
pub(super) async fn health() -> Json<Value> {
    Json(json!({ "status": "ok" }))
}

/// Which program this is.
#[utoipa::path(
    get, path = "/version", tag = "operation",
    responses((status = 200, description = "Name and version", body = answers::Version)),
)]
pub(super) async fn version() -> Json<Value> {
    Json(json!({ "name": "ngf-grasp", "version": env!("CARGO_PKG_VERSION") }))
}

/// Answers with 200 once requests can be served.
#[utoipa::path(
    get, path = "/readyz", tag = "operation",
    responses((status = 200, description = "It can serve", body = answers::Health)),
)]
pub(super) async fn ready(State(state): State<AppState>) -> Response {
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
#[utoipa::path(
    get, path = "/api/v1", tag = "operation",
    responses((status = 200, description = "Addresses and limits", body = answers::Api)),
)]
pub(super) async fn discover(State(state): State<AppState>) -> Json<Value> {
    let url = |rest: &str| format!("/api/v1/{rest}");
    Json(json!({
        "object": "api", "version": env!("CARGO_PKG_VERSION"),
        "jobs_enabled": state.engine.is_some(),
        "urls": {
            "jobs": url("jobs"), "stream": url("stream?jobs="), "models": url("models"),
            "datasets": url("datasets"), "meshes": url("meshes"), "artifacts": url("artifacts"),
        },
        "limits": {
            "request_bytes": MOST_BODY, "mesh_bytes": MOST_BYTES, "mesh_triangles": MAX_TRIANGLES,
            "kept_mesh_bytes": state.limits.kept_mesh_bytes, "queued_jobs": state.limits.queued,
            "changes_per_second": state.limits.changes_per_second,
        },
    }))
}
