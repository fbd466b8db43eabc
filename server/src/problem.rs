//! The one shape of an error: `application/problem+json` (RFC 9457).

use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;

/// What went wrong, for a program (`code`) and for a person (`detail`, `hint`).
#[derive(Clone, Debug)]
pub struct Problem {
    /// The HTTP status.
    pub status: StatusCode,
    /// Stable name of this kind of problem.
    pub code: &'static str,
    /// What happened to this request.
    pub detail: String,
    /// What to do about it.
    pub hint: String,
}

impl Problem {
    /// Nothing lives at this path.
    pub(crate) fn not_found(path: &str) -> Self {
        Self {
            status: StatusCode::NOT_FOUND,
            code: "not_found",
            detail: format!("there is nothing at {path}"),
            hint: "GET /api/v1/models lists the models; the page is at /".into(),
        }
    }

    /// The path exists, the method does not.
    pub(crate) fn method_not_allowed(method: &str, path: &str) -> Self {
        Self {
            status: StatusCode::METHOD_NOT_ALLOWED,
            code: "method_not_allowed",
            detail: format!("{path} does not answer {method}"),
            hint: "the Allow header names the methods that it answers".into(),
        }
    }

    /// The server could not read its own files.
    pub(crate) fn unreadable(error: &std::io::Error) -> Self {
        Self {
            status: StatusCode::INTERNAL_SERVER_ERROR,
            code: "file_unreadable",
            detail: format!("a file could not be read: {error}"),
            hint: "check that the server may read its page and models folders".into(),
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        // "about:blank" says that `title` is the status's own phrase; `code` tells kinds apart.
        let body = json!({
            "type": "about:blank",
            "title": self.status.canonical_reason().unwrap_or("Error"),
            "status": self.status.as_u16(),
            "detail": self.detail,
            "code": self.code,
            "hint": self.hint,
        });
        let mut response = (self.status, Json(body)).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        response
    }
}
