//! Limits of connections, on a socket.

use crate::{state_with_scheduler, test_state};
use server::{app, serve};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

const MAX_CONNECTIONS: usize = 20;

/// A server with up to [`MAX_CONNECTIONS`] connections; returns its address and the switch that stops it.
async fn start(folder: &std::path::Path) -> (std::net::SocketAddr, watch::Sender<bool>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (stop, stopping) = watch::channel(false);
    let (state, scheduler) = state_with_scheduler(folder, "ngf".into(), 0).await;
    // Streams end when the switch is dropped.
    let state = state.with_scheduler(scheduler, stopping.clone());
    tokio::spawn(serve(listener, app(state), MAX_CONNECTIONS, stopping));
    (address, stop)
}

async fn open(address: std::net::SocketAddr, text: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(text.as_bytes()).await.unwrap();
    stream
}

/// Sends a request on a connection of its own; returns the response.
async fn request(address: std::net::SocketAddr, path: &str) -> String {
    let head = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    let mut stream = open(address, &head).await;
    let mut response = Vec::new();
    tokio::time::timeout(Duration::from_secs(5), stream.read_to_end(&mut response))
        .await
        .unwrap()
        .unwrap();
    String::from_utf8(response).unwrap()
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
    let mut streams = Vec::new();
    for _ in 0..18 {
        let head = "GET /api/v1/stream HTTP/1.1\r\nHost: localhost\r\n\r\n";
        let mut stream = open(address, head).await;
        let mut response = vec![0; 4096];
        let read = stream.read(&mut response).await.unwrap();
        assert!(response[..read].starts_with(b"HTTP/1.1 200"));
        streams.push(stream);
    }
    let rejected = request(address, "/api/v1/stream").await;
    assert!(
        rejected.starts_with("HTTP/1.1 503") && rejected.contains("too_many_streams"),
        "{rejected}"
    );
    for _ in 0..2 * MAX_CONNECTIONS {
        assert!(request(address, "/healthz").await.starts_with("HTTP/1.1 200"));
    }
    for stream in &mut streams {
        let mut text = [0; 4096];
        // Only the opening comment may remain.
        let read = tokio::time::timeout(Duration::from_millis(1), stream.read(&mut text)).await;
        assert!(!matches!(read, Ok(Ok(0) | Err(_))), "{read:?}");
    }
    stop.send_replace(true);
}

#[tokio::test]
async fn connections_close_when_the_server_stops() {
    let folder = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (stop, stopping) = watch::channel(false);
    let server = tokio::spawn(serve(listener, app(test_state(folder.path()).await), 20, stopping));
    let mut idle = open(address, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").await;
    assert!(idle.read(&mut [0; 4096]).await.unwrap() > 0);
    stop.send_replace(true);
    tokio::time::timeout(Duration::from_secs(5), server).await.unwrap().unwrap();
    while idle.read(&mut [0; 4096]).await.is_ok_and(|read| read > 0) {}
    assert!(TcpStream::connect(address).await.is_err());
}
