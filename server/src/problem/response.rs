//! Errors of the store as problems, and the response with a problem.

use super::{Problem, ProblemCode};
use crate::store::StoreError;
use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        if error.is_disk_full() {
            return Self::no_space(&error.to_string());
        }
        tracing::error!(%error, "store error");
        if let StoreError::Damaged(..) = error {
            return Self::record_damaged(&error.to_string());
        }
        let hint = "see the server log; no data was lost";
        let status = StatusCode::INTERNAL_SERVER_ERROR;
        Self::new(status, ProblemCode::StorageFailed, error.to_string(), hint)
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        // With "about:blank", `title` is the phrase of the status; `code` identifies the error.
        let mut body = json!({
            "type": "about:blank",
            "title": self.status.canonical_reason().unwrap_or("Error"),
            "status": self.status.as_u16(),
            "detail": self.detail,
            "code": self.code,
            "hint": self.hint,
        });
        if let Some(param) = &self.param {
            body["errors"] = json!([{ "param": param, "detail": self.detail }]);
        }
        if let Some(id) = crate::middleware::request_log::current_request_id() {
            body["request_id"] = id.into();
        }
        let is_busy = self.status == StatusCode::SERVICE_UNAVAILABLE;
        let mut response = (self.status, Json(body)).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if is_busy {
            headers.insert(header::RETRY_AFTER, HeaderValue::from_static("10"));
        }
        response
    }
}
