//! Middleware: authorization and rate limits, the request log, and response headers.

pub(crate) mod access;
pub(crate) mod auth;
pub(crate) mod credentials;
pub(crate) mod headers;
pub(crate) mod request_log;
