//! Authorization of requests: host name, token, origin check, rate limit.

use super::access::{Access, Challenge};
use super::credentials::{Credentials, bearer_token};
use crate::quotas::Quotas;
use crate::{AppState, Problem};
use axum::extract::{ConnectInfo, Request, State};
use axum::http::{HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use governor::clock::{Clock, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

/// Rate limiter of write requests, by client address.
#[derive(Debug)]
pub(crate) struct WriteRateLimiter {
    authorized: DefaultKeyedRateLimiter<IpAddr>,
    /// Requests without the token. They are counted apart, because a client without the token can share its
    /// address with others.
    unauthorized: DefaultKeyedRateLimiter<IpAddr>,
}

/// Number of tracked addresses above which idle ones are dropped.
const MAX_TRACKED_ADDRESSES: usize = 10_000;

impl WriteRateLimiter {
    /// Rate limiter without recorded requests.
    pub(crate) fn new(limits: &Quotas) -> Self {
        let limiter = || RateLimiter::keyed(Quota::per_second(limits.max_writes_per_second));
        Self { authorized: limiter(), unauthorized: limiter() }
    }

    /// Counts a request; returns the time to wait if the limit is exceeded.
    fn check(&self, address: IpAddr, is_authorized: bool) -> Result<(), Duration> {
        let limiter = if is_authorized { &self.authorized } else { &self.unauthorized };
        if limiter.len() > MAX_TRACKED_ADDRESSES {
            limiter.retain_recent();
        }
        let clock = DefaultClock::default();
        limiter.check_key(&address).map_err(|not_until| not_until.wait_time_from(clock.now()))
    }
}

/// Middleware that rejects requests for other hosts, without a required token, from disallowed origins, or above
/// the rate limit.
pub(crate) async fn authorize(
    State(state): State<AppState>,
    request: Request,
    next: Next,
) -> Response {
    let headers = request.headers();
    let (method, path) = (request.method(), request.uri().path());
    let peer = request.extensions().get::<ConnectInfo<SocketAddr>>().map(|peer| peer.0.ip());
    // Probes address the server by any name and reveal nothing.
    let is_probe = matches!(path, "/healthz" | "/readyz");
    if let Some(host) = headers.get(header::HOST).filter(|_| !is_probe) {
        let host = host.to_str().unwrap_or_default();
        if !state.access.is_own_host(host) {
            return Problem::host_not_allowed(host).into_response();
        }
    }
    let credentials = Credentials::of(headers);
    if matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS) {
        if let Some(challenge) = state.access.read_challenge(method, path, &credentials) {
            return unauthorized(challenge);
        }
    } else if let Some(rejection) = reject_write(&state, &request, peer) {
        return rejection;
    }
    let is_https = state.access.is_https(peer, headers);
    let cookie = state.access.new_cookie(&credentials, is_https);
    let mut response = next.run(request).await;
    if state.access.reads_need_token() {
        keep_private(&mut response);
    }
    if let Some(cookie) = cookie.and_then(|cookie| HeaderValue::from_str(&cookie).ok()) {
        response.headers_mut().append(header::SET_COOKIE, cookie);
    }
    response
}

/// Response to a write request that is not permitted.
fn reject_write(state: &AppState, request: &Request, peer: Option<IpAddr>) -> Option<Response> {
    let headers = request.headers();
    let is_allowed =
        |origin: &str| state.origins.iter().any(|allowed| allowed.as_bytes() == origin.as_bytes());
    if let Some(origin) = Access::foreign_origin(headers).filter(|origin| !is_allowed(origin)) {
        return Some(Problem::origin_not_allowed(origin).into_response());
    }
    // Workers have their own tokens and are not rate-limited.
    if is_worker_report(request.method(), request.uri().path()) {
        return None;
    }
    // A cookie does not suffice: pages of other origins could use it.
    let is_authorized = state.access.token_matches(bearer_token(headers));
    let client = peer.map(|peer| state.access.client_address(peer, headers));
    if let Some(Err(wait)) = client.map(|client| state.write_rate.check(client, is_authorized)) {
        let seconds = wait.as_secs_f64().ceil().max(1.0);
        let retry_after = [(header::RETRY_AFTER, seconds.to_string())];
        let max = state.quotas.max_writes_per_second.get();
        return Some((retry_after, Problem::rate_limited(max)).into_response());
    }
    (!is_authorized).then(|| unauthorized(Challenge::Bearer))
}

/// Response to a request that lacks the token.
fn unauthorized(challenge: Challenge) -> Response {
    let challenge = match challenge {
        Challenge::Bearer => "Bearer",
        Challenge::Basic => {
            "Basic realm=\"ngf-grasp: any name, the token as password\", charset=\"UTF-8\""
        }
    };
    ([(header::WWW_AUTHENTICATE, challenge)], Problem::unauthorized()).into_response()
}

/// Shared caches must not keep responses that need the token.
fn keep_private(response: &mut Response) {
    let policy =
        response.headers().get(header::CACHE_CONTROL).and_then(|value| value.to_str().ok());
    let private = policy.and_then(|policy| policy.strip_prefix("public"));
    let private = private.and_then(|rest| HeaderValue::from_str(&format!("private{rest}")).ok());
    if let Some(private) = private {
        response.headers_mut().insert(header::CACHE_CONTROL, private);
    }
}

/// Whether a request is a worker report.
fn is_worker_report(method: &Method, path: &str) -> bool {
    let id = path.strip_prefix("/api/v1/jobs/").and_then(|rest| rest.strip_suffix("/reports"));
    method == Method::POST && id.is_some_and(|id| !id.contains('/'))
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
}
