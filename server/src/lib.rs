//! The HTTP side: the built page, and the models that it runs.
//!
//! In: a folder with the page and a folder with models. Out: one axum `Router`. Opens no socket and
//! knows nothing of physics or learning; `ngf serve` binds it to an address.

mod headers;
mod model;
mod problem;
mod routes;
mod state;

pub use problem::Problem;
pub use state::AppState;

/// All routes with their headers. Every error, wherever it arises, is a [`Problem`].
pub fn app(state: AppState) -> axum::Router {
    routes::router().layer(axum::middleware::map_response(headers::secure)).with_state(state)
}
