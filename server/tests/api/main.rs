//! The server by request and answer, without a socket.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

mod files;
mod jobs;
mod meshes;
mod openapi;
mod operation;
mod workers;

use axum::Router;
use axum::body::Body;
use axum::http::{Request, StatusCode};
use axum::response::Response;
use http_body_util::BodyExt;
use serde_json::{Value, json};
use server::engine::{Engine, EngineConfig};
use server::{AppState, app};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use tokio::sync::watch;
use tower::ServiceExt;

/// A server whose engine does not work on its jobs, and the folder that it keeps.
async fn idle() -> (Router, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let state = idle_in(folder.path()).await;
    (app(state), folder)
}

async fn idle_in(folder: &Path) -> AppState {
    working_with(folder, "ngf".into(), 0).await.0
}

/// A server in `folder` and its engine, which does jobs with `program` once it is told to work, and
/// warns where fewer than `free_bytes` of the disk are free.
async fn working_with(folder: &Path, program: PathBuf, free_bytes: u64) -> (AppState, Arc<Engine>) {
    let config = EngineConfig {
        data: folder.join("data"),
        models: folder.join("models"),
        program,
        places: 1,
        free_bytes,
    };
    let engine = Engine::open(config).await.unwrap();
    let state = AppState::new(&folder.join("web"), &folder.join("models"));
    (state.with_engine(engine.clone(), watch::channel(false).1), engine)
}

/// Asks something of the API.
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

async fn assert_problem(answer: Response, status: u16, code: &str) -> Value {
    assert_eq!(answer.headers()["content-type"], "application/problem+json");
    assert_eq!(answer.status(), status, "{code}");
    let problem = json_of(answer).await;
    assert_eq!(problem["code"], code, "{problem}");
    problem
}

/// Asks for a small dataset.
async fn ask(app: &Router, name: &str) -> String {
    let body = json!({ "kind": "dataset.generate", "name": name, "metadata": { "of": name } });
    let answer = send(app, "POST", "/jobs", body.to_string()).await;
    assert_eq!(answer.status(), StatusCode::CREATED);
    let location = answer.headers()["location"].to_str().unwrap().to_owned();
    let job = json_of(answer).await;
    let id = job["id"].as_str().unwrap().to_owned();
    assert_eq!(location, format!("/api/v1/jobs/{id}"));
    id
}
