//! HTTP server: the built page, the models that it runs, and jobs that generate datasets and train policies.
//!
//! In: a folder with the page, one with models and, for jobs, a data folder. Out: one axum `Router`. `ngf
//! serve` binds a listener, on which [`serve`] accepts connections. Runs no simulation and no training: each job is a separate
//! worker process, `ngf-worker`, that reports to this server.

mod archive;
mod connections;
mod extract;
mod jobs;
mod metrics;
mod middleware;
mod model;
mod model_manifest;
mod problem;
mod quotas;
mod routes;
mod state;
mod store;

use axum::body::Body;
use axum::response::IntoResponse;
use middleware::{auth, headers, request_log};
use std::time::Duration;
use tower::ServiceBuilder;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::map_request_body::MapRequestBodyLayer;
use tower_http::timeout::RequestBodyTimeoutLayer;

pub use connections::{ConnectionLimits, serve};
pub use jobs::scheduler;
pub use problem::{Problem, ProblemCode};
pub use quotas::Quotas;
pub use state::AppState;

/// OpenAPI 3.1 description of all endpoints.
pub fn openapi() -> utoipa::openapi::OpenApi {
    routes::router().1
}

/// The server drops a request whose body makes no progress for this long.
const BODY_IDLE_TIMEOUT: Duration = Duration::from_secs(30);

/// Builds the router with all routes and middleware. Every error response is a [`Problem`].
pub fn app(state: AppState) -> axum::Router {
    let authorize = axum::middleware::from_fn_with_state(state.clone(), auth::authorize);
    let log_request = axum::middleware::from_fn_with_state(state.clone(), request_log::log_request);
    let security_headers = axum::middleware::map_response(headers::security_headers);
    let relax_request = axum::middleware::map_request(headers::ignore_unsatisfiable_accept);
    let catch_panic = CatchPanicLayer::custom(|_| Problem::internal().into_response());
    let (router, _) = routes::router();
    let body_timeout = ServiceBuilder::new()
        .layer(RequestBodyTimeoutLayer::new(BODY_IDLE_TIMEOUT))
        .layer(MapRequestBodyLayer::new(Body::new));
    let router = router
        .layer(headers::compression())
        .layer(relax_request)
        .layer(catch_panic)
        .layer(body_timeout)
        .layer(authorize);
    let router = match headers::cors(&state.origins) {
        Some(cors) => router.layer(cors),
        None => router,
    };
    router.layer(log_request).layer(security_headers).with_state(state)
}
