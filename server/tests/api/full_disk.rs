//! A full disk: a small memory file system, where the tests may mount one.

use crate::connections::{listen, open};
use crate::{assert_problem, create_job, json_of, send, test_state};
use axum::Router;
use axum::body::Body;
use axum::http::{Request, StatusCode};
use axum::response::Response;
use server::{ConnectionLimits, Quotas, app};
use std::io::Write;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::watch;
use tower::ServiceExt;

/// A mounted file system of 24 MB.
struct SmallDisk(TempDir);

impl SmallDisk {
    /// Mounts the file system; `None`, with a message, without the permission to do so.
    fn mount() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=24m", "tmpfs"]).arg(folder.path());
        match mount.output() {
            Ok(output) if output.status.success() => Some(Self(folder)),
            Ok(output) => {
                let reason = String::from_utf8_lossy(&output.stderr).into_owned();
                println!("skipped: cannot mount a tmpfs: {reason}");
                None
            }
            Err(error) => {
                println!("skipped: cannot run mount: {error}");
                None
            }
        }
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    /// Fills the disk up to this number of free bytes; returns the file that does so.
    fn fill(&self, free: u64) -> PathBuf {
        let path = self.path().join("filler");
        let mut file = std::fs::File::create(&path).unwrap();
        let block = [0; 4096];
        while file.write_all(&block).is_ok() {}
        let length = file.metadata().unwrap().len();
        file.set_len(length.saturating_sub(free)).unwrap();
        path
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Open files of the server do not prevent a lazy unmount.
        Command::new("umount").arg("-l").arg(self.path()).status().ok();
    }
}

/// A server with its data on this disk that keeps no space free.
async fn small_app(disk: &SmallDisk) -> Router {
    let quotas = Quotas { min_free_bytes: 0, ..Quotas::default() };
    app(test_state(disk.path()).await.with_quotas(quotas))
}

async fn readiness(app: &Router) -> Response {
    app.clone().oneshot(Request::get("/readyz").body(Body::empty()).unwrap()).await.unwrap()
}

const DATASET: &str = r#"{"kind": "dataset.generate"}"#;

#[tokio::test]
async fn requests_succeed_as_soon_as_a_full_disk_has_space() {
    let Some(disk) = SmallDisk::mount() else { return };
    let app = small_app(&disk).await;
    let id = create_job(&app, "x").await;
    for free in [0, 96 << 10] {
        let filler = disk.fill(free);
        for _ in 0..3 {
            assert_problem(send(&app, "POST", "/jobs", DATASET).await, 507, "disk_full").await;
        }
        assert_problem(readiness(&app).await, 503, "not_ready").await;
        std::fs::remove_file(filler).unwrap();
        let response = send(&app, "POST", "/jobs", DATASET).await;
        assert_eq!(response.status(), StatusCode::CREATED);
        assert_eq!(readiness(&app).await.status(), StatusCode::OK);
    }
    // Requests that the check of the free space does not cover.
    let filler = disk.fill(0);
    let mut failures = 0;
    for number in 0..50 {
        let patch = format!(r#"{{"name": "{}"}}"#, "x".repeat(100 + number));
        let response = send(&app, "PATCH", &format!("/jobs/{id}"), patch).await;
        if response.status() != StatusCode::OK {
            failures += 1;
            assert_problem(response, 507, "disk_full").await;
        }
    }
    assert!(failures > 40, "{failures}");
    std::fs::remove_file(filler).unwrap();
    let response = send(&app, "PATCH", &format!("/jobs/{id}"), r#"{"name": "last"}"#).await;
    assert_eq!(json_of(response).await["name"], "last");
}

#[tokio::test]
async fn upload_without_space_is_rejected_and_leaves_no_file() {
    let Some(disk) = SmallDisk::mount() else { return };
    let app = small_app(&disk).await;
    let filler = disk.fill(5 << 20);
    let mesh = vec![b'v'; 23 << 20];
    assert_problem(send(&app, "POST", "/meshes", mesh).await, 507, "disk_full").await;
    assert_eq!(std::fs::read_dir(disk.path().join("data/uploads")).unwrap().count(), 0);
    std::fs::remove_file(filler).unwrap();
}

/// Response with which the server requests the body.
const CONTINUE: &str = "HTTP/1.1 100 Continue\r\n\r\n";

/// Sends the head of an upload of `length` bytes and, if the server requests the body, its first line; returns
/// the connection and the response to the head.
async fn send_half(address: SocketAddr, length: u64) -> (TcpStream, String) {
    let head = format!(
        "POST /api/v1/meshes HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n\
         Expect: 100-continue\r\nConnection: close\r\n\r\n"
    );
    let mut stream = open(address, &head).await;
    let (mut response, mut part) = (String::new(), [0; 4096]);
    while response != CONTINUE {
        let read = tokio::time::timeout(Duration::from_secs(5), stream.read(&mut part)).await;
        // Any other response ends with the connection.
        let Ok(count @ 1..) = read.unwrap() else { return (stream, response) };
        response += &String::from_utf8_lossy(&part[..count]);
    }
    stream.write_all(b"v 0 0 0\n").await.unwrap();
    (stream, response)
}

#[tokio::test]
async fn second_half_sent_upload_is_rejected_if_the_disk_has_space_for_one() {
    // The other tests do not change the free space of this folder.
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
    let folder = folder.unwrap();
    let state = test_state(folder.path()).await;
    let data = folder.path().join("data");
    let free = fs4::statvfs(&data).unwrap().available_space();
    // An upload reserves twice its length: there is space for one and a half.
    let length = (free / 5).min(50_000_000);
    let quotas = Quotas { min_free_bytes: free - 3 * length, ..Quotas::default() };
    let (_stop, stopping) = watch::channel(false);
    let router = app(state.with_quotas(quotas));
    let (address, _) = listen(router, ConnectionLimits::new(20), stopping).await;
    let (first, response) = send_half(address, length).await;
    assert_eq!(response, CONTINUE);
    let (_, response) = send_half(address, length).await;
    assert!(response.starts_with("HTTP/1.1 507") && response.contains("disk_full"), "{response}");
    // An interrupted upload releases its space.
    drop(first);
    let start = Instant::now();
    while std::fs::read_dir(data.join("uploads")).unwrap().count() > 0 {
        assert!(start.elapsed() < Duration::from_secs(5), "the upload still has its file");
        tokio::task::yield_now().await;
    }
    let (_third, response) = send_half(address, length).await;
    assert_eq!(response, CONTINUE);
}

#[tokio::test]
async fn finished_jobs_can_be_deleted_on_a_full_disk() {
    let Some(disk) = SmallDisk::mount() else { return };
    let app = small_app(&disk).await;
    let id = create_job(&app, "x").await;
    send(&app, "POST", &format!("/jobs/{id}/cancel"), "").await;
    let folder = disk.path().join("data/work").join(&id);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("log.txt"), vec![b'x'; 2 << 20]).unwrap();
    disk.fill(0);
    let response = send(&app, "DELETE", &format!("/jobs/{id}?artifacts=true"), "").await;
    assert_eq!(response.status(), StatusCode::NO_CONTENT);
    assert!(!folder.exists());
}
