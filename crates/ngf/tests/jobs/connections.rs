//! Idle and slow connections with a low limit of open files.

use crate::server::Server;
use crate::stress::resident;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// A server with this limit of open files.
fn start(open_files: usize, data: &Path) -> Server {
    let mut shell = Command::new("sh");
    let serve = format!("ulimit -n {open_files} && exec \"$0\" serve --port 0 --data-dir \"$1\"");
    shell.arg("-c").arg(serve).arg(env!("CARGO_BIN_EXE_ngf")).arg(data);
    Server::spawn(shell.env("NGF_LOG", "warn"))
}

/// Permits this process this number of open files; `false`, with a message, if the hard limit is lower.
fn raise_own_limit(open_files: u64) -> bool {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit { current: limit.current.map(|now| now.max(open_files)), ..limit };
    let is_raised = setrlimit(Resource::Nofile, raised).is_ok();
    if !is_raised {
        println!("skipped: the hard limit of open files is below {open_files}");
    }
    is_raised
}

/// Opens connections that send nothing, an incomplete head, or one request.
fn open_slow(server: &Server, count: usize) -> Vec<TcpStream> {
    let address = server.url.strip_prefix("http://").unwrap();
    let heads = ["", "GET / HTTP/1.1\r\nX: ", "GET /version HTTP/1.1\r\nHost: localhost\r\n\r\n"];
    let open = |number: usize| {
        let mut stream = TcpStream::connect(address).unwrap();
        // The server may have closed it already.
        stream.write_all(heads[number % 3].as_bytes()).ok();
        stream
    };
    (0..count).map(open).collect()
}

/// Asserts that the liveness probe answers within 100 ms, on a new connection.
fn assert_responsive(server: &Server) {
    let start = Instant::now();
    server.get_path("/healthz");
    let elapsed = start.elapsed();
    assert!(elapsed < Duration::from_millis(100), "{elapsed:?}");
}

#[test]
fn idle_connections_beyond_the_open_files_do_not_block_others() {
    if !raise_own_limit(400) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let server = start(256, &folder.path().join("data"));
    let _slow = open_slow(&server, 300);
    for _ in 0..3 {
        assert_responsive(&server);
    }
}

#[test]
#[ignore = "a minute: cargo xtask stress"]
fn slow_connections_are_closed_within_a_minute() {
    if !raise_own_limit(1400) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let server = start(1024, &folder.path().join("data"));
    let mut slow = open_slow(&server, 1100);
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(25) {
        assert_responsive(&server);
        // A byte of the head every few seconds does not extend its time.
        for stream in &mut slow {
            stream.write_all(b"x").ok();
        }
        std::thread::sleep(Duration::from_secs(2));
    }
    for stream in &mut slow {
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        while stream.read(&mut [0; 4096]).is_ok_and(|read| read > 0) {}
    }
    println!("1,100 slow connections closed after {:?}", start.elapsed());
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
}

/// Number of event streams in the tests of many streams.
const STREAMS: usize = 9000;

/// Limit of open files that permits [`STREAMS`].
const STREAMS_OPEN_FILES: usize = 20_000;

/// Opens [`STREAMS`] event streams and reads the start of their responses.
fn open_streams(server: &Server) -> Vec<TcpStream> {
    let address = server.url.strip_prefix("http://").unwrap();
    let open = |_| {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(b"GET /api/v1/stream HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
        stream
    };
    let mut streams: Vec<TcpStream> = (0..STREAMS).map(open).collect();
    for stream in &mut streams {
        stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        let mut head = [0; 12];
        stream.read_exact(&mut head).unwrap();
        assert_eq!(&head, b"HTTP/1.1 200");
    }
    streams
}

#[test]
#[ignore = "seconds: cargo xtask stress"]
fn memory_is_returned_after_nine_thousand_streams() {
    if !raise_own_limit(STREAMS_OPEN_FILES as u64) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let server = start(STREAMS_OPEN_FILES, &folder.path().join("data"));
    let before = resident(server.pid());
    let streams = open_streams(&server);
    let during = resident(server.pid());
    drop(streams);
    let start = Instant::now();
    let metrics = || {
        let mut response = ureq::get(format!("{}/metrics", server.url)).call().unwrap();
        response.body_mut().read_to_string().unwrap()
    };
    // The allocator returns memory with a delay, while the server answers requests.
    let after = loop {
        let is_idle = metrics().lines().any(|line| line == "ngf_sse_clients 0");
        let after = resident(server.pid());
        if is_idle && after < before + 100_000_000 {
            break after;
        }
        assert!(start.elapsed() < Duration::from_secs(30), "{before} {during} {after}");
        std::thread::sleep(Duration::from_millis(100));
    };
    println!(
        "memory: {} MB, with {STREAMS} streams {} MB, after them {} MB",
        before >> 20,
        during >> 20,
        after >> 20
    );
}

#[test]
#[ignore = "seconds: cargo xtask stress"]
fn nine_thousand_streams_are_open_at_once() {
    if !raise_own_limit(STREAMS_OPEN_FILES as u64) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let server = start(STREAMS_OPEN_FILES, &folder.path().join("data"));
    let mut streams = open_streams(&server);
    server.get_path("/healthz");
    let id = server.create_job("dataset.generate", serde_json::json!({ "preset": "smoke" }));
    for stream in &mut streams {
        let mut text = String::new();
        while !text.contains(&id) {
            let mut part = [0; 4096];
            let read = stream.read(&mut part).unwrap();
            assert!(read > 0, "a stream has ended: {text}");
            text += &String::from_utf8_lossy(&part[..read]);
        }
    }
}
