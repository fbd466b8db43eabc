//! Who may ask for a change, and how often: whoever has the token, where one is set, and no page of somebody else's.

use crate::limits::Limits;
use crate::{AppState, Problem};
use axum::extract::{ConnectInfo, Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use governor::clock::{Clock, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

/// How often each address asked of late.
#[derive(Debug)]
pub(crate) struct Pace(DefaultKeyedRateLimiter<IpAddr>);

/// Addresses that are remembered at most, before those that were silent are forgotten.
const MOST_ADDRESSES: usize = 10_000;

impl Pace {
    /// Nobody has asked yet.
    pub(crate) fn new(limits: &Limits) -> Self {
        Self(RateLimiter::keyed(Quota::per_second(limits.changes_per_second)))
    }

    /// Counts a request; says how long to wait if there were too many.
    fn count(&self, address: IpAddr) -> Result<(), Duration> {
        if self.0.len() > MOST_ADDRESSES {
            self.0.retain_recent();
        }
        let clock = DefaultClock::default();
        self.0.check_key(&address).map_err(|early| early.wait_time_from(clock.now()))
    }
}

/// Refuses changes by pages of other origins, by those without the token, and by those who ask too often.
pub(crate) async fn guard(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let is_read = matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS);
    // A job's process has a token of its own, and reports as often as it has to.
    let is_report = is_report(request.method(), request.uri().path());
    if !is_read {
        if let Some(origin) = foreign_origin(request.headers(), &state) {
            return Problem::foreign_origin(&origin).into_response();
        }
        let host = request.headers().get(header::HOST).and_then(|host| host.to_str().ok());
        if let Some(host) = host.filter(|host| !state.has_token() && !is_loopback(host)) {
            return Problem::foreign_origin(host).into_response();
        }
        if !is_report {
            // Those who try tokens are counted, too.
            let from = request.extensions().get::<ConnectInfo<SocketAddr>>();
            if let Some(Err(wait)) = from.map(|ConnectInfo(from)| state.pace.count(from.ip())) {
                let seconds = wait.as_secs_f64().ceil().max(1.0);
                let after = [(header::RETRY_AFTER, seconds.to_string())];
                let most = state.limits.changes_per_second.get();
                return (after, Problem::too_often(most)).into_response();
            }
            if !state.admits(bearer(request.headers())) {
                let challenge = [(header::WWW_AUTHENTICATE, "Bearer")];
                return (challenge, Problem::unauthorized()).into_response();
            }
        }
    }
    next.run(request).await
}

/// Whether a request reports on a job.
fn is_report(method: &Method, path: &str) -> bool {
    let id = path.strip_prefix("/api/v1/jobs/").and_then(|rest| rest.strip_suffix("/reports"));
    method == Method::POST && id.is_some_and(|id| !id.contains('/'))
}

/// Whether a host is this machine. A page can give its own name our address; it cannot take ours.
fn is_loopback(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    name == "localhost" || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
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
    let is_allowed = || state.origins.iter().any(|allowed| allowed.as_bytes() == origin.as_bytes());
    (!is_own && !is_allowed()).then(|| origin.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_report_is_a_report() {
        assert!(is_report(&Method::POST, "/api/v1/jobs/job_1/reports"));
        for path in ["/api/v1/jobs/reports", "/api/v1/jobs/a/b/reports", "/api/v1/models/a/reports"]
        {
            assert!(!is_report(&Method::POST, path), "{path}");
        }
        assert!(!is_report(&Method::DELETE, "/api/v1/jobs/job_1/reports"));
    }

    #[test]
    fn only_this_machine_is_this_machine() {
        for host in ["localhost", "localhost:8787", "127.0.0.1:1", "127.1.2.3", "[::1]:8787"] {
            assert!(is_loopback(host), "{host}");
        }
        for host in ["", "evil.example:8787", "localhost.evil.example", "10.0.0.1", "[::2]:1"] {
            assert!(!is_loopback(host), "{host}");
        }
    }
}
