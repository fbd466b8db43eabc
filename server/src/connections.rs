//! Accepts TCP connections and serves HTTP/1.1 on them, with bounds on their number and on slow clients.
//!
//! | a connection | is closed |
//! |---|---|
//! | without a complete request head | [`ConnectionLimits::head_timeout`] after its start, or after the previous response |
//! | whose client does not read the response | [`WRITE_TIMEOUT`] after the last accepted byte |
//! | that is idle for the longest time | when a new one exceeds the maximum number |
//!
//! Bodies have their own limits. If none is idle, the connection with the longest request is closed. Event streams and requests that wait for a change are exempt.

mod registry;
mod tracked_body;

use crate::Problem;
use crate::middleware::headers;
use axum::Router;
use axum::body::Body;
use axum::extract::ConnectInfo;
use axum::http::{Method, Request, Uri};
use axum::response::{IntoResponse, Response};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use registry::{Connection, Registry};
use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio_io_timeout::TimeoutStream;
use tower::ServiceExt;
use tracked_body::TrackedBody;

/// Default of [`ConnectionLimits::head_timeout`].
const HEAD_TIMEOUT: Duration = Duration::from_secs(30);

/// Time after which a response ends if the client accepts no byte of it.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);

/// Pause after a connection could not be accepted, e.g. because of too many open files.
const ACCEPT_RETRY: Duration = Duration::from_millis(50);

/// Limits on the connections of a server.
#[derive(Clone, Copy, Debug)]
pub struct ConnectionLimits {
    /// Maximum number of open connections, at least 2.
    pub max_connections: usize,
    /// Time in which the head of a request must arrive, measured from the start of the connection or from the end
    /// of the previous response. Proxies must close idle connections earlier.
    pub head_timeout: Duration,
}

impl ConnectionLimits {
    /// Limits for up to `max_connections` connections, with 30 s for a request head.
    pub fn new(max_connections: usize) -> Self {
        Self { max_connections, head_timeout: HEAD_TIMEOUT }
    }
}

/// Serves `router` on a listener until `stopping` becomes true, then until all responses are complete.
pub async fn serve(
    listener: TcpListener,
    router: Router,
    limits: ConnectionLimits,
    mut stopping: watch::Receiver<bool>,
) {
    let registry = Arc::new(Registry::new(limits.max_connections));
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            // An error means that the sender was dropped, so the server stops.
            _ = stopping.wait_for(|stopping| *stopping) => break,
        };
        match accepted {
            Ok(accepted) => {
                if let Some(connection) = registry.admit().await {
                    let (router, stopping) = (router.clone(), stopping.clone());
                    let timeout = limits.head_timeout;
                    tokio::spawn(serve_connection(accepted, router, connection, timeout, stopping));
                }
            }
            Err(error) if is_of_client(&error) => {}
            Err(error) => {
                registry.log_failure(&error);
                registry.close_longest_idle(Duration::ZERO);
                tokio::time::sleep(ACCEPT_RETRY).await;
            }
        }
    }
    drop(listener);
    registry.all_closed().await;
}

/// Whether the client has closed the connection before it was accepted.
fn is_of_client(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}

/// Serves the requests of one connection.
async fn serve_connection(
    (stream, address): (TcpStream, SocketAddr),
    router: Router,
    connection: Connection,
    head_timeout: Duration,
    mut stopping: watch::Receiver<bool>,
) {
    // Small responses and events are sent immediately.
    stream.set_nodelay(true).ok();
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(WRITE_TIMEOUT));
    let handle = connection.handle();
    let service = service_fn(move |request: Request<Incoming>| {
        let (router, handle) = (router.clone(), handle.clone());
        async move {
            let is_long_lived = is_long_lived(request.method(), request.uri());
            let Some(running) = handle.begin_request(is_long_lived) else {
                let rejected = Problem::too_many_streams().into_response();
                return Ok(headers::security_headers(rejected).await);
            };
            let mut request = request.map(Body::new);
            request.extensions_mut().insert(ConnectInfo(address));
            let response: Response = match router.oneshot(request).await {
                Ok(response) => response,
                Err(never) => match never {},
            };
            Ok::<_, Infallible>(response.map(|body| Body::new(TrackedBody::new(body, running))))
        }
    });
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(head_timeout)
        .serve_connection(TokioIo::new(Box::pin(stream)), service);
    let mut served = pin!(served);
    let mut is_stopping = false;
    loop {
        tokio::select! {
            // Errors are those of the client, such as a closed connection.
            _ = served.as_mut() => return,
            () = connection.closed() => return,
            _ = stopping.wait_for(|stopping| *stopping), if !is_stopping => {
                is_stopping = true;
                served.as_mut().graceful_shutdown();
            }
        }
    }
}

/// Whether the response to a request takes long although the client is neither idle nor slow: an event stream,
/// or a request that waits for a change.
fn is_long_lived(method: &Method, uri: &Uri) -> bool {
    let waits = |query: &str| query.split('&').any(|pair| pair.starts_with("wait="));
    *method == Method::GET && (uri.path().ends_with("/stream") || uri.query().is_some_and(waits))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_streams_and_waiting_requests_are_long_lived() {
        let is_long = |method, uri: &'static str| is_long_lived(&method, &Uri::from_static(uri));
        assert!(is_long(Method::GET, "/api/v1/stream?jobs=job_1"));
        assert!(is_long(Method::GET, "/api/v1/jobs/job_1/stream"));
        assert!(is_long(Method::GET, "/api/v1/jobs/job_1?a=b&wait=30s"));
        for uri in ["/api/v1/jobs/job_1", "/api/v1/jobs?await=1", "/healthz"] {
            assert!(!is_long(Method::GET, uri), "{uri}");
        }
        assert!(!is_long(Method::POST, "/api/v1/jobs/job_1/stream"));
    }
}
