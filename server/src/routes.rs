//! Which path leads where.

mod answers;
mod artifacts;
mod content;
mod course;
mod datasets;
mod events;
mod job_files;
mod job_request;
mod jobs;
mod list;
mod meshes;
mod models;
mod operation;
mod page;

use crate::engine::Engine;
use crate::extract::MOST_BODY;
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

/// All routes, and their description.
pub(crate) fn router() -> (Router<AppState>, OpenApi) {
    let short = OpenApiRouter::new()
        .routes(routes!(jobs::list, jobs::create))
        .routes(routes!(jobs::get, jobs::patch, jobs::delete))
        .routes(routes!(jobs::report))
        .routes(routes!(events::list))
        .routes(routes!(events::stream_of))
        .routes(routes!(course::metrics))
        .routes(routes!(job_files::logs))
        .routes(routes!(job_files::checkpoints))
        .routes(routes!(job_files::artifacts))
        .routes(routes!(jobs::act))
        .routes(routes!(events::stream_all))
        .routes(routes!(artifacts::get))
        .routes(routes!(datasets::list))
        .routes(routes!(datasets::get, datasets::delete))
        .routes(routes!(datasets::episodes))
        .routes(routes!(datasets::episode))
        .layer(DefaultBodyLimit::max(MOST_BODY));
    // An upload has bounds of its own; this one is of a form, with what is about its file.
    let meshes = OpenApiRouter::new()
        .routes(routes!(meshes::list, meshes::upload))
        .routes(routes!(meshes::get, meshes::delete))
        .routes(routes!(meshes::file))
        .layer(DefaultBodyLimit::max(meshes::MOST_BYTES + meshes::FORM));
    let v1 = OpenApiRouter::new()
        .routes(routes!(models::list))
        .routes(routes!(models::card, models::delete))
        .routes(routes!(models::file))
        .merge(short)
        .merge(meshes);
    let (v1, mut api) = OpenApiRouter::new().nest("/api/v1", v1).split_for_parts();
    let (operation, described) = OpenApiRouter::new()
        .routes(routes!(operation::discover))
        .routes(routes!(operation::health))
        .routes(routes!(operation::ready))
        .routes(routes!(operation::version))
        .routes(routes!(operation::metrics))
        .routes(routes!(operation::openapi))
        .split_for_parts();
    api.merge(described);
    let router = Router::new()
        .merge(operation)
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

async fn not_found(uri: Uri) -> Problem {
    Problem::not_found(uri.path())
}

async fn method_not_allowed(method: Method, uri: Uri) -> Problem {
    Problem::method_not_allowed(method.as_str(), uri.path())
}
