//! What is noted of every request: a name that stands in the answer and in the log, and how long it took.

use crate::AppState;
use crate::metrics::RequestLabels;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method};
use axum::middleware::Next;
use axum::response::Response;
use std::time::Instant;

/// The header with the name of a request.
pub(crate) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Characters of a name that somebody else gave, at most.
const LONGEST: usize = 64;

tokio::task_local! {
    /// Name of the request that is being answered.
    static CURRENT: String;
}

/// Name of the request that is being answered, if one is.
pub(crate) fn current() -> Option<String> {
    CURRENT.try_with(Clone::clone).ok()
}

/// Names a request, or keeps the name that it brings, and notes how it went.
pub(crate) async fn observe(
    State(state): State<AppState>,
    request: Request,
    next: Next,
) -> Response {
    let given = request.headers().get(REQUEST_ID).and_then(|value| value.to_str().ok());
    let id = given
        .filter(|id| is_plain(id))
        .map_or_else(|| format!("req_{}", uuid::Uuid::now_v7().simple()), str::to_owned);
    let method = request.method().clone();
    let path = request.uri().path().to_owned();
    // A label with what clients make up would never stop growing.
    let route = request.extensions().get::<MatchedPath>().map(|path| path.as_str().to_owned());
    let began = Instant::now();
    let mut answer = CURRENT.scope(id.clone(), next.run(request)).await;
    let seconds = began.elapsed().as_secs_f64();
    let status = answer.status();
    let labels = RequestLabels {
        method: known(&method),
        route: route.unwrap_or_default(),
        status: status.as_u16(),
    };
    state.metrics.requests.get_or_create(&labels).observe(seconds);
    let milliseconds = (1e4 * seconds).round() / 10.0;
    let status = status.as_u16();
    if answer.status().is_server_error() {
        tracing::warn!(%method, path, status, milliseconds, request = id, "answered");
    } else if method.is_safe() || path.ends_with("/reports") {
        tracing::debug!(%method, path, status, milliseconds, request = id, "answered");
    } else {
        tracing::info!(%method, path, status, milliseconds, request = id, "answered");
    }
    if let Ok(value) = HeaderValue::from_str(&id) {
        answer.headers_mut().insert(REQUEST_ID, value);
    }
    answer
}

/// Whether a name can stand in a log without harm.
fn is_plain(id: &str) -> bool {
    let is_good = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    (1..=LONGEST).contains(&id.len()) && id.chars().all(is_good)
}

fn known(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PATCH => "PATCH",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}
