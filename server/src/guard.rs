//! Who may ask for a change: whoever has the token, where one is set, and no page of somebody else's.

use crate::{AppState, Problem};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Refuses changes by pages of other origins, and by those without the token.
pub(crate) async fn guard(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let is_read = matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS);
    // A job's process has a token of its own.
    let is_report = request.uri().path().ends_with("/reports");
    if !is_read {
        if let Some(origin) = foreign_origin(request.headers(), &state) {
            return Problem::foreign_origin(&origin).into_response();
        }
        if !is_report && !state.admits(bearer(request.headers())) {
            let challenge = [(header::WWW_AUTHENTICATE, "Bearer")];
            return (challenge, Problem::unauthorized()).into_response();
        }
    }
    next.run(request).await
}

/// The token that a request brings.
pub(crate) fn bearer(headers: &HeaderMap) -> &str {
    let value = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    value.and_then(|value| value.strip_prefix("Bearer ")).unwrap_or_default()
}

/// The origin of the page that asks, if it is neither ours nor allowed: a browser sends requests of any page to a server
/// on the loopback address.
fn foreign_origin(headers: &HeaderMap, state: &AppState) -> Option<String> {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let origin = text(header::ORIGIN)?;
    let host = text(header::HOST).unwrap_or_default();
    let is_own = origin.split_once("://").is_some_and(|(_, rest)| rest == host);
    (!is_own && !state.origins.iter().any(|allowed| allowed == origin)).then(|| origin.to_owned())
}
