//! Axum extractors whose rejections are [`Problem`]s.

use crate::Problem;
use axum::extract::{FromRequest, FromRequestParts, Request};
use axum::http::StatusCode;
use axum::http::request::Parts;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::time::Duration;

/// Path parameters.
pub(crate) struct Path<T>(pub(crate) T);

/// Query parameters.
pub(crate) struct Query<T>(pub(crate) T);

/// Query parameters by name; each may be given once.
pub(crate) struct Parameters(BTreeMap<String, String>);

impl Parameters {
    /// The parameters, which must be some of `names`.
    pub(crate) fn only(self, names: &[&str]) -> Result<BTreeMap<String, String>, Problem> {
        match self.0.keys().find(|name| !names.contains(&name.as_str())) {
            Some(name) => {
                let expected = match names {
                    [] => "unknown parameter; expected none".to_owned(),
                    names => format!("unknown parameter; expected {}", names.join(", ")),
                };
                Err(Problem::invalid_parameter(name, expected))
            }
            None => Ok(self.0),
        }
    }

    /// All parameters. Libraries of event streams add some of their own.
    pub(crate) fn all(self) -> BTreeMap<String, String> {
        self.0
    }
}

/// Request body, read completely into memory; limited by [`MAX_BODY`].
pub(crate) struct FullBody(pub(crate) axum::body::Bytes);

/// Maximum length of a request body, except uploads (bytes). Worker reports are the largest: they contain all
/// events since the last report.
pub(crate) const MAX_BODY: usize = 4 << 20;

/// Time in which the whole body must arrive. Limits slow bodies; stalled bodies end after the shorter idle
/// timeout.
const BODY_TIMEOUT: Duration = Duration::from_secs(45);

impl<S: Send + Sync> FromRequest<S> for FullBody {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<Self, Problem> {
        let body = axum::body::Bytes::from_request(request, state);
        let body = tokio::time::timeout(BODY_TIMEOUT, body).await;
        let body = body.map_err(|_| Problem::request_timeout(BODY_TIMEOUT))?;
        Ok(Self(body.map_err(|rejection| match rejection.status() {
            StatusCode::PAYLOAD_TOO_LARGE => Problem::body_too_large(MAX_BODY),
            _ => Problem::incomplete_body(&rejection.body_text()),
        })?))
    }
}

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for Path<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let params = axum::extract::Path::<T>::from_request_parts(parts, state).await;
        let params = params.map_err(|rejection| Problem::invalid_query(&rejection.body_text()))?;
        Ok(Self(params.0))
    }
}

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let params = axum::extract::Query::<T>::from_request_parts(parts, state).await;
        let params = params.map_err(|rejection| Problem::invalid_query(&rejection.body_text()))?;
        Ok(Self(params.0))
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Parameters {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let Query(pairs) = Query::<Vec<(String, String)>>::from_request_parts(parts, state).await?;
        let mut parameters = BTreeMap::new();
        for (name, value) in pairs {
            if parameters.insert(name.clone(), value).is_some() {
                return Err(Problem::invalid_parameter(&name, "is given twice"));
            }
        }
        Ok(Self(parameters))
    }
}
