//! Authorization of write requests: bearer token, origin check, rate limit.

use crate::quotas::Quotas;
use crate::{AppState, Problem};
use axum::extract::{ConnectInfo, Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use governor::clock::{Clock, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

/// Rate limiter of write requests, by client address.
#[derive(Debug)]
pub(crate) struct WriteRateLimiter(DefaultKeyedRateLimiter<IpAddr>);

/// Number of tracked addresses above which idle ones are dropped.
const MAX_TRACKED_ADDRESSES: usize = 10_000;

impl WriteRateLimiter {
    /// Rate limiter without recorded requests.
    pub(crate) fn new(limits: &Quotas) -> Self {
        Self(RateLimiter::keyed(Quota::per_second(limits.max_writes_per_second)))
    }

    /// Counts a request; returns the time to wait if the limit is exceeded.
    fn check(&self, address: IpAddr) -> Result<(), Duration> {
        if self.0.len() > MAX_TRACKED_ADDRESSES {
            self.0.retain_recent();
        }
        let clock = DefaultClock::default();
        self.0.check_key(&address).map_err(|not_until| not_until.wait_time_from(clock.now()))
    }
}

/// Middleware that rejects write requests from disallowed origins, without the token, or above the rate
/// limit.
pub(crate) async fn authorize(
    State(state): State<AppState>,
    request: Request,
    next: Next,
) -> Response {
    let is_read = matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS);
    // Workers have their own tokens and are not rate-limited.
    let is_report = is_worker_report(request.method(), request.uri().path());
    if !is_read {
        if let Some(origin) = disallowed_origin(request.headers(), &state) {
            return Problem::origin_not_allowed(&origin).into_response();
        }
        let host = request.headers().get(header::HOST).and_then(|host| host.to_str().ok());
        if let Some(host) = host.filter(|host| !state.has_token() && !is_loopback(host)) {
            return Problem::origin_not_allowed(host).into_response();
        }
        if !is_report {
            // Checked before the token, so that guesses are limited.
            let client = request.extensions().get::<ConnectInfo<SocketAddr>>();
            if let Some(Err(wait)) =
                client.map(|ConnectInfo(client)| state.write_rate.check(client.ip()))
            {
                let seconds = wait.as_secs_f64().ceil().max(1.0);
                let retry_after = [(header::RETRY_AFTER, seconds.to_string())];
                let max = state.quotas.max_writes_per_second.get();
                return (retry_after, Problem::rate_limited(max)).into_response();
            }
            if !state.token_matches(bearer_token(request.headers())) {
                let challenge = [(header::WWW_AUTHENTICATE, "Bearer")];
                return (challenge, Problem::unauthorized()).into_response();
            }
        }
    }
    next.run(request).await
}

/// Whether a request is a worker report.
fn is_worker_report(method: &Method, path: &str) -> bool {
    let id = path.strip_prefix("/api/v1/jobs/").and_then(|rest| rest.strip_suffix("/reports"));
    method == Method::POST && id.is_some_and(|id| !id.contains('/'))
}

/// Whether a host name refers to this machine. DNS rebinding maps a foreign name to the loopback address, but
/// cannot change the name in the `Host` header.
fn is_loopback(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    name == "localhost" || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Bearer token of a request; empty if there is none.
pub(crate) fn bearer_token(headers: &HeaderMap) -> &str {
    let value = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    value.and_then(|value| value.strip_prefix("Bearer ")).unwrap_or_default()
}

/// Origin of a browser request that is neither the server's own nor allowed. Browsers send requests of any
/// page to a server on the loopback address.
fn disallowed_origin(headers: &HeaderMap, state: &AppState) -> Option<String> {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let origin = text(header::ORIGIN)?;
    let host = text(header::HOST).unwrap_or_default();
    let is_own = origin.split_once("://").is_some_and(|(_, rest)| rest == host);
    let is_allowed = || state.origins.iter().any(|allowed| allowed.as_bytes() == origin.as_bytes());
    (!is_own && !is_allowed()).then(|| origin.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_report_paths_are_worker_reports() {
        assert!(is_worker_report(&Method::POST, "/api/v1/jobs/job_1/reports"));
        for path in ["/api/v1/jobs/reports", "/api/v1/jobs/a/b/reports", "/api/v1/models/a/reports"]
        {
            assert!(!is_worker_report(&Method::POST, path), "{path}");
        }
        assert!(!is_worker_report(&Method::DELETE, "/api/v1/jobs/job_1/reports"));
    }

    #[test]
    fn only_loopback_hosts_are_local() {
        for host in ["localhost", "localhost:8787", "127.0.0.1:1", "127.1.2.3", "[::1]:8787"] {
            assert!(is_loopback(host), "{host}");
        }
        for host in ["", "evil.example:8787", "localhost.evil.example", "10.0.0.1", "[::2]:1"] {
            assert!(!is_loopback(host), "{host}");
        }
    }
}
