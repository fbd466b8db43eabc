//! Limits of connections, on a socket.

use crate::{state_with_scheduler, test_state};
use axum::Router;
use server::{ConnectionLimits, app, serve};
use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::JoinHandle;

const MAX_CONNECTIONS: usize = 20;

/// Number of event streams that these connections permit.
const MAX_STREAMS: usize = 18;

/// A server with up to [`MAX_CONNECTIONS`] connections; returns its address and the switch that stops it.
async fn start(folder: &Path) -> (SocketAddr, watch::Sender<bool>) {
    start_with(folder, ConnectionLimits::new(MAX_CONNECTIONS)).await
}

/// A server with these limits; returns its address and the switch that stops it.
async fn start_with(folder: &Path, limits: ConnectionLimits) -> (SocketAddr, watch::Sender<bool>) {
    let (stop, stopping) = watch::channel(false);
    let (state, scheduler) = state_with_scheduler(folder, "ngf".into(), 0).await;
    // Streams end when the switch is dropped.
    let state = state.with_scheduler(scheduler, stopping.clone());
    let (address, _) = listen(app(state), limits, stopping).await;
    (address, stop)
}

/// Serves `router` on a free port; returns the address and the task, which continues if it is dropped.
pub(crate) async fn listen(
    router: Router,
    limits: ConnectionLimits,
    stopping: watch::Receiver<bool>,
) -> (SocketAddr, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    (address, tokio::spawn(serve(listener, router, limits, stopping)))
}

/// Opens a connection and sends this text.
pub(crate) async fn open(address: SocketAddr, text: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(text.as_bytes()).await.unwrap();
    stream
}

/// Sends a request on a connection of its own; returns the response.
async fn request(address: SocketAddr, path: &str) -> String {
    let head = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    let mut stream = open(address, &head).await;
    let mut response = Vec::new();
    tokio::time::timeout(Duration::from_secs(5), stream.read_to_end(&mut response))
        .await
        .unwrap()
        .unwrap();
    String::from_utf8(response).unwrap()
}

/// Opens event streams and reads the start of their responses.
async fn open_streams(address: SocketAddr, count: usize) -> Vec<TcpStream> {
    let mut streams = Vec::new();
    for _ in 0..count {
        let head = "GET /api/v1/stream HTTP/1.1\r\nHost: localhost\r\n\r\n";
        let mut stream = open(address, head).await;
        let mut response = vec![0; 4096];
        let read = stream.read(&mut response).await.unwrap();
        assert!(response[..read].starts_with(b"HTTP/1.1 200"));
        streams.push(stream);
    }
    streams
}

/// Asserts that the server has not ended these event streams.
async fn assert_open(streams: &mut [TcpStream]) {
    for stream in streams {
        let mut text = [0; 4096];
        // Only the opening comment may remain.
        while let Ok(read) =
            tokio::time::timeout(Duration::from_millis(1), stream.read(&mut text)).await
        {
            assert!(read.is_ok_and(|count| count > 0), "a stream has ended");
        }
    }
}

/// Number of open event streams, from the metrics of the server.
async fn num_open_streams(address: SocketAddr) -> usize {
    let text = request(address, "/metrics").await;
    let number = text.lines().find_map(|line| line.strip_prefix("ngf_sse_clients "));
    number.unwrap().parse().unwrap()
}

/// Time after which the server closes a connection that sends `head`, then `later` every 20 ms.
async fn lifetime(address: SocketAddr, head: &str, later: &str) -> Duration {
    let start = Instant::now();
    let mut stream = open(address, head).await;
    let closed = async {
        loop {
            let mut response = [0; 4096];
            let read = stream.read(&mut response);
            match tokio::time::timeout(Duration::from_millis(20), read).await {
                Ok(Ok(0) | Err(_)) => return,
                Ok(Ok(_)) => {}
                Err(_) => {
                    // The server may have closed the connection.
                    stream.write_all(later.as_bytes()).await.ok();
                }
            }
        }
    };
    let closed = tokio::time::timeout(Duration::from_secs(10), closed).await;
    assert!(closed.is_ok(), "{head:?} keeps the connection open");
    start.elapsed()
}

#[tokio::test]
async fn connections_without_a_complete_head_are_closed_at_the_time_limit() {
    let folder = tempfile::tempdir().unwrap();
    let head_timeout = Duration::from_millis(300);
    let limits = ConnectionLimits { head_timeout, ..ConnectionLimits::new(MAX_CONNECTIONS) };
    let (address, _stop) = start_with(folder.path(), limits).await;
    let mut streams = open_streams(address, 1).await;
    let (silent, slow, idle) = tokio::join!(
        lifetime(address, "", ""),
        // More bytes of the head do not extend its time.
        lifetime(address, "GET / HTTP/1.1\r\nX: ", "x"),
        lifetime(address, "GET /version HTTP/1.1\r\nHost: localhost\r\n\r\n", ""),
    );
    for time in [silent, slow, idle] {
        assert!(time >= head_timeout, "{silent:?} {slow:?} {idle:?}");
    }
    // The limit does not apply to responses.
    assert_open(&mut streams).await;
}

#[tokio::test]
async fn idle_and_slow_connections_give_way_to_new_ones() {
    let folder = tempfile::tempdir().unwrap();
    let (address, _stop) = start(folder.path()).await;
    let mut connections = Vec::new();
    for number in 0..3 * MAX_CONNECTIONS {
        // Nothing, an incomplete head, or a connection kept open after a response.
        let text =
            ["", "GET / HTTP/1.1\r\nX: ", "GET /version HTTP/1.1\r\nHost: localhost\r\n\r\n"];
        connections.push(open(address, text[number % 3]).await);
    }
    let start = Instant::now();
    assert!(request(address, "/healthz").await.starts_with("HTTP/1.1 200"));
    assert!(start.elapsed() < Duration::from_millis(100), "{:?}", start.elapsed());
    // The first one was idle for the longest time.
    let closed = tokio::time::timeout(Duration::from_secs(5), connections[0].read(&mut [0])).await;
    assert!(matches!(closed.unwrap(), Ok(0) | Err(_)));
}

#[tokio::test]
async fn streams_are_not_closed_for_new_connections() {
    let folder = tempfile::tempdir().unwrap();
    let (address, stop) = start(folder.path()).await;
    let mut streams = open_streams(address, MAX_STREAMS).await;
    let rejected = request(address, "/api/v1/stream").await;
    assert!(
        rejected.starts_with("HTTP/1.1 503") && rejected.contains("too_many_streams"),
        "{rejected}"
    );
    for _ in 0..2 * MAX_CONNECTIONS {
        assert!(request(address, "/healthz").await.starts_with("HTTP/1.1 200"));
    }
    assert_open(&mut streams).await;
    stop.send_replace(true);
}

#[tokio::test]
async fn event_streams_of_disconnected_clients_are_released() {
    let folder = tempfile::tempdir().unwrap();
    let (address, _stop) = start(folder.path()).await;
    // A round can open its streams only if those of the previous one are released.
    for _ in 0..3 {
        let streams = open_streams(address, MAX_STREAMS).await;
        assert_eq!(num_open_streams(address).await, MAX_STREAMS);
        drop(streams);
        let start = Instant::now();
        while num_open_streams(address).await > 0 {
            assert!(start.elapsed() < Duration::from_secs(5), "streams are still open");
        }
    }
}

#[tokio::test]
async fn connections_close_when_the_server_stops() {
    let folder = tempfile::tempdir().unwrap();
    let (stop, stopping) = watch::channel(false);
    let router = app(test_state(folder.path()).await);
    let limits = ConnectionLimits::new(MAX_CONNECTIONS);
    let (address, server) = listen(router, limits, stopping).await;
    let mut idle = open(address, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").await;
    assert!(idle.read(&mut [0; 4096]).await.unwrap() > 0);
    stop.send_replace(true);
    tokio::time::timeout(Duration::from_secs(5), server).await.unwrap().unwrap();
    while idle.read(&mut [0; 4096]).await.is_ok_and(|read| read > 0) {}
    assert!(TcpStream::connect(address).await.is_err());
}
