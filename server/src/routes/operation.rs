//! For those who operate the server, and for programs that want to know it.

use crate::{AppState, Problem};
use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
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
    /// Stable name of this kind of problem.
    code: String,
    /// What to do about it.
    hint: String,
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
pub(super) async fn openapi() -> Json<OpenApi> {
    Json(crate::openapi())
}

/// Numbers for Prometheus.
pub(super) async fn metrics(State(state): State<AppState>) -> Result<Response, Problem> {
    let jobs = match &state.engine {
        Some(engine) => engine.store.counts().await?,
        None => Vec::new(),
    };
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    Ok(([(header::CONTENT_TYPE, kind)], state.metrics.written(jobs)).into_response())
}
