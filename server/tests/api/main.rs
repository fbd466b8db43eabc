//! API tests: requests and responses, without a socket.

#![allow(clippy::unwrap_used, reason = "test helpers fail by panicking")]

mod access;
mod archives;
mod clients;
mod connections;
mod database;
mod files;
mod full_disk;
mod jobs;
mod meshes;
mod openapi;
mod system;
mod workers;

use axum::Router;
use axum::body::Body;
use axum::http::{Request, StatusCode};
use axum::response::Response;
use http_body_util::BodyExt;
use serde_json::{Value, json};
use server::scheduler::{JobScheduler, SchedulerConfig};
use server::{AppState, app};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use tokio::sync::watch;
use tower::ServiceExt;

/// A server that does not start its jobs, and its data folder.
async fn test_app() -> (Router, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let state = test_state(folder.path()).await;
    (app(state), folder)
}

async fn test_state(folder: &Path) -> AppState {
    state_with_scheduler(folder, "ngf".into(), 0).await.0
}

/// State of a server in `folder`, and its scheduler, which starts `program` for each job once it runs. Alerts
/// are raised when less than `min_free_bytes` of disk space is free.
async fn state_with_scheduler(
    folder: &Path,
    program: PathBuf,
    min_free_bytes: u64,
) -> (AppState, Arc<JobScheduler>) {
    state_with(folder, SchedulerConfig { min_free_bytes, ..config(folder, program) }).await
}

fn config(folder: &Path, program: PathBuf) -> SchedulerConfig {
    SchedulerConfig {
        data_dir: folder.join("data"),
        models_dir: folder.join("models"),
        program,
        waits_for_program: false,
        max_concurrent: 1,
        min_free_bytes: 0,
    }
}

async fn state_with(folder: &Path, config: SchedulerConfig) -> (AppState, Arc<JobScheduler>) {
    let scheduler = JobScheduler::open(config).await.unwrap();
    let state = AppState::new(&folder.join("web"), &folder.join("models"));
    (state.with_scheduler(scheduler.clone(), watch::channel(false).1), scheduler)
}

/// Sends a request to the API.
async fn send(app: &Router, method: &str, path: &str, body: impl Into<Body>) -> Response {
    send_with(app, method, path, body, &[]).await
}

async fn send_with(
    app: &Router,
    method: &str,
    path: &str,
    body: impl Into<Body>,
    headers: &[(&str, &str)],
) -> Response {
    let request = Request::builder().method(method).uri(format!("/api/v1{path}"));
    let request = headers.iter().fold(request, |r, (name, value)| r.header(*name, *value));
    app.clone().oneshot(request.body(body.into()).unwrap()).await.unwrap()
}

async fn json_of(response: Response) -> Value {
    let bytes = response.into_body().collect().await.unwrap().to_bytes();
    serde_json::from_slice(&bytes).unwrap_or_else(|e| panic!("{e}: {bytes:?}"))
}

/// Asserts status and code of an error response; returns its body.
async fn assert_problem(response: Response, status: u16, code: &str) -> Value {
    assert_eq!(response.headers()["content-type"], "application/problem+json");
    assert_eq!(response.status(), status, "{code}");
    let problem = json_of(response).await;
    assert_eq!(problem["code"], code, "{problem}");
    problem
}

/// Creates a dataset job with this name.
async fn create_job(app: &Router, name: &str) -> String {
    let body = json!({ "kind": "dataset.generate", "name": name, "metadata": { "of": name } });
    let response = send(app, "POST", "/jobs", body.to_string()).await;
    assert_eq!(response.status(), StatusCode::CREATED);
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    let job = json_of(response).await;
    let id = job["id"].as_str().unwrap().to_owned();
    assert_eq!(location, format!("/api/v1/jobs/{id}"));
    id
}
