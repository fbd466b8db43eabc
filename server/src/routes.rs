//! Routing table and OpenAPI description.

mod artifacts;
mod dataset_files;
mod datasets;
mod event_stream;
mod events;
mod http_content;
mod job_files;
mod job_request;
mod job_request_schema;
mod jobs;
mod meshes;
mod metric_cache;
mod metric_table;
mod metrics;
mod model_archives;
mod models;
mod openapi;
mod pagination;
mod prometheus_text;
mod schemas;
mod static_files;
mod system;
mod unique_json;

pub(crate) use metric_cache::MetricCache;

use crate::extract::MAX_BODY;
use crate::jobs::scheduler::JobScheduler;
use crate::{AppState, Problem};
use axum::Router;
use axum::extract::{DefaultBodyLimit, FromRequestParts};
use axum::http::request::Parts;
use axum::http::{Method, Uri};
use axum::routing::any;
use std::sync::Arc;
use utoipa::openapi::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Router of all endpoints, and their OpenAPI description.
pub(crate) fn router() -> (Router<AppState>, OpenApi) {
    let api_routes = OpenApiRouter::new()
        .routes(routes!(jobs::list, jobs::create))
        .routes(routes!(jobs::get, jobs::patch, jobs::delete))
        .routes(routes!(jobs::report))
        .routes(routes!(events::list))
        .routes(routes!(events::stream_of))
        .routes(routes!(metrics::metrics))
        .routes(routes!(job_files::logs))
        .routes(routes!(job_files::checkpoints))
        .routes(routes!(job_files::artifacts))
        .routes(routes!(jobs::action))
        .routes(routes!(events::stream_all))
        .routes(routes!(artifacts::get))
        .routes(routes!(datasets::list, dataset_files::import))
        .routes(routes!(datasets::get, datasets::delete))
        .routes(routes!(dataset_files::files))
        .routes(routes!(dataset_files::file))
        .routes(routes!(dataset_files::archive))
        .routes(routes!(datasets::episodes))
        .routes(routes!(datasets::episode))
        .layer(DefaultBodyLimit::max(MAX_BODY));
    // The handler limits the file; this limit also covers the overhead of a form.
    let meshes = OpenApiRouter::new()
        .routes(routes!(meshes::list, meshes::upload))
        .routes(routes!(meshes::get, meshes::delete))
        .routes(routes!(meshes::file))
        .layer(DefaultBodyLimit::max(meshes::MAX_MESH_BYTES + meshes::FORM_OVERHEAD));
    let v1 = OpenApiRouter::new()
        .routes(routes!(models::list, model_archives::import))
        .routes(routes!(models::get, models::delete))
        .routes(routes!(model_archives::archive))
        .routes(routes!(models::file))
        .merge(api_routes)
        .merge(meshes);
    let (v1, mut api) = OpenApiRouter::new().nest("/api/v1", v1).split_for_parts();
    let (system, system_api) = OpenApiRouter::new()
        .routes(routes!(system::index))
        .routes(routes!(system::health))
        .routes(routes!(system::ready))
        .routes(routes!(system::version))
        .routes(routes!(system::metrics))
        .routes(routes!(openapi::openapi))
        .split_for_parts();
    api.merge(system_api);
    let router = Router::new()
        .merge(system)
        .route("/api/{*rest}", any(not_found))
        .merge(v1)
        .fallback(static_files::file)
        .method_not_allowed_fallback(method_not_allowed);
    (router, openapi::complete(api))
}

/// Extractor of the job scheduler; rejects the request if jobs are disabled.
pub(crate) struct RequireScheduler(pub(crate) Arc<JobScheduler>);

impl FromRequestParts<AppState> for RequireScheduler {
    type Rejection = Problem;

    async fn from_request_parts(_: &mut Parts, state: &AppState) -> Result<Self, Problem> {
        state.scheduler.clone().map(Self).ok_or_else(Problem::jobs_disabled)
    }
}

async fn not_found(uri: Uri) -> Problem {
    Problem::not_found(uri.path())
}

async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    Problem::method_not_allowed(method.as_str(), uri.path())
}
