//! Request log: an id for each request, returned to the client and logged with status and duration.

use crate::AppState;
use crate::metrics::RequestLabels;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method};
use axum::middleware::Next;
use axum::response::Response;
use std::time::Instant;

/// Header that carries the request id.
pub(crate) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Maximum length of a request id supplied by a client.
const MAX_ID_LENGTH: usize = 64;

tokio::task_local! {
    /// Id of the current request.
    static CURRENT: String;
}

/// Id of the current request; `None` outside of a request.
pub(crate) fn current_request_id() -> Option<String> {
    CURRENT.try_with(Clone::clone).ok()
}

/// Middleware that assigns a request id, or uses a valid one of the client, and records metrics and the log
/// line.
pub(crate) async fn log_request(
    State(state): State<AppState>,
    request: Request,
    next: Next,
) -> Response {
    let given = request.headers().get(REQUEST_ID).and_then(|value| value.to_str().ok());
    let id = given
        .filter(|id| is_safe_id(id))
        .map_or_else(|| format!("req_{}", uuid::Uuid::now_v7().simple()), str::to_owned);
    let method = request.method().clone();
    let path = request.uri().path().to_owned();
    // The route, not the path: labels with client-supplied text would be unbounded.
    let route = request.extensions().get::<MatchedPath>().map(|path| path.as_str().to_owned());
    let started = Instant::now();
    let mut response = CURRENT.scope(id.clone(), next.run(request)).await;
    let seconds = started.elapsed().as_secs_f64();
    let status = response.status();
    let labels = RequestLabels {
        method: method_label(&method),
        route: route.unwrap_or_default(),
        status: status.as_u16(),
    };
    state.metrics.request_duration.get_or_create(&labels).observe(seconds);
    let milliseconds = (1e4 * seconds).round() / 10.0;
    let status = status.as_u16();
    // Workers repeat a report every second while the disk is full; the scheduler logs that once per minute.
    let is_repeated = status == 507 && path.ends_with("/reports");
    if response.status().is_server_error() && !is_repeated {
        tracing::warn!(%method, path, status, milliseconds, request = id, "response");
    } else if method.is_safe() || path.ends_with("/reports") {
        tracing::debug!(%method, path, status, milliseconds, request = id, "response");
    } else {
        tracing::info!(%method, path, status, milliseconds, request = id, "response");
    }
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(REQUEST_ID, value);
    }
    response
}

/// Whether a client-supplied id is safe to log.
fn is_safe_id(id: &str) -> bool {
    let is_allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    (1..=MAX_ID_LENGTH).contains(&id.len()) && id.chars().all(is_allowed)
}

/// Label of a method; unknown methods share one label.
fn method_label(method: &Method) -> &'static str {
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
