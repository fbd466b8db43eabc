//! The HTTP side: the built page, the models that it runs, and jobs that make data and models.
//!
//! In: a folder with the page, one with models, and, for jobs, one for data. Out: one axum `Router`. Opens no socket,
//! and does no physics or learning: a job is a process of its own, `ngf`, that reports here. `ngf serve` binds it to an
//! address.

pub mod engine;
mod extract;
mod guard;
mod headers;
mod job;
mod limits;
mod metrics;
mod model;
mod observe;
mod problem;
mod routes;
mod state;
mod store;

use axum::body::Body;
use axum::response::IntoResponse;
use std::time::Duration;
use tower::ServiceBuilder;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::map_request_body::MapRequestBodyLayer;
use tower_http::timeout::RequestBodyTimeoutLayer;

pub use limits::Limits;
pub use problem::{Code, Problem};
pub use state::AppState;

/// The description of all requests (OpenAPI 3.1).
pub fn openapi() -> utoipa::openapi::OpenApi {
    routes::router().1
}

/// Whoever sends a body and then nothing for so long is no longer heard.
const SILENCE: Duration = Duration::from_secs(30);

/// All routes with their headers. Every error, wherever it arises, is a [`Problem`].
pub fn app(state: AppState) -> axum::Router {
    let guard = axum::middleware::from_fn_with_state(state.clone(), guard::guard);
    let observe = axum::middleware::from_fn_with_state(state.clone(), observe::observe);
    let secure = axum::middleware::map_response(headers::secure);
    let lenient = axum::middleware::map_request(headers::lenient);
    let caught = CatchPanicLayer::custom(|_| Problem::panicked().into_response());
    let (router, _) = routes::router();
    let in_time = ServiceBuilder::new()
        .layer(RequestBodyTimeoutLayer::new(SILENCE))
        .layer(MapRequestBodyLayer::new(Body::new));
    let router = router
        .layer(headers::compressed())
        .layer(lenient)
        .layer(caught)
        .layer(in_time)
        .layer(guard);
    let router = match headers::shared(&state.origins) {
        Some(shared) => router.layer(shared),
        None => router,
    };
    router.layer(observe).layer(secure).with_state(state)
}
