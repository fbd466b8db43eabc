//! Parts of a request, refused as every error is told.

use crate::Problem;
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::StatusCode;
use axum::http::request::Parts;
use serde::de::DeserializeOwned;
use std::time::Duration;

/// Parameters in the path.
pub(crate) struct Path<T>(pub(crate) T);

/// Parameters after the path.
pub(crate) struct Query<T>(pub(crate) T);

/// A short body as a whole.
pub(crate) struct Whole(pub(crate) axum::body::Bytes);

/// Bytes of a short body; a report of a job's process brings what was said since the last one.
pub(crate) const MOST_BODY: usize = 4 << 20;

/// How long it may take to arrive: one that is silent is given up earlier, one that trickles now.
const MOST_TIME: Duration = Duration::from_secs(60);

impl<S: Send + Sync> FromRequest<S> for Whole {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<Self, Problem> {
        let read = axum::body::Bytes::from_request(request, state);
        let read = tokio::time::timeout(MOST_TIME, read).await;
        let read = read.map_err(|_| Problem::too_slow(MOST_TIME))?;
        Ok(Self(read.map_err(|rejection| match rejection.status() {
            StatusCode::PAYLOAD_TOO_LARGE => Problem::too_large(MOST_BODY),
            _ => Problem::broken_off(&rejection.body_text()),
        })?))
    }
}

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for Path<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let found = axum::extract::Path::<T>::from_request_parts(parts, state).await;
        let found = found.map_err(|rejection| Problem::invalid_address(&rejection.body_text()))?;
        Ok(Self(found.0))
    }
}

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let found = axum::extract::Query::<T>::from_request_parts(parts, state).await;
        let found = found.map_err(|rejection| Problem::invalid_address(&rejection.body_text()))?;
        Ok(Self(found.0))
    }
}
