//! What operators and their programs ask, and what they bound.

use crate::{assert_problem, idle, idle_in, json_of, send, send_with};
use axum::Router;
use axum::body::Body;
use axum::extract::ConnectInfo;
use axum::http::{HeaderValue, Request, StatusCode};
use axum::response::Response;
use http_body_util::BodyExt;
use server::{Limits, app};
use std::net::SocketAddr;
use std::num::NonZeroU32;
use tempfile::TempDir;
use tower::ServiceExt;

async fn get(app: &Router, path: &str) -> Response {
    let request = Request::get(path).body(Body::empty()).unwrap();
    let answer = app.clone().oneshot(request).await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK, "{path}");
    answer
}

async fn metrics(app: &Router) -> String {
    let body = get(app, "/metrics").await.into_body().collect().await.unwrap();
    String::from_utf8(body.to_bytes().to_vec()).unwrap()
}

#[tokio::test]
async fn a_server_says_how_it_is() {
    let (app, _folder) = idle().await;
    assert_eq!(json_of(get(&app, "/readyz").await).await["status"], "ready");
    let version = json_of(get(&app, "/version").await).await;
    assert_eq!(version["version"], env!("CARGO_PKG_VERSION"));
    let job = send(&app, "POST", "/jobs", DATASET).await;
    assert_eq!(job.status(), StatusCode::CREATED);
    send(&app, "GET", "/jobs/job_1", "").await;
    send(&app, "GET", "/jobs/job_2", "").await;
    let text = metrics(&app).await;
    for line in [
        r#"ngf_jobs{kind="dataset.generate",status="queued"} 1"#,
        r#"ngf_jobs{kind="policy.train",status="running"} 0"#,
        // One row for all jobs, however many there are.
        r#"ngf_http_request_duration_seconds_count{method="GET",route="/api/v1/jobs/{id}",status="404"} 2"#,
        "ngf_sse_clients 0",
        "# EOF",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
}

const DATASET: &str = r#"{"kind": "dataset.generate"}"#;

#[tokio::test]
async fn the_description_is_served() {
    let (app, _folder) = idle().await;
    let described = json_of(get(&app, "/openapi.json").await).await;
    assert!(described["openapi"].as_str().unwrap().starts_with("3.1"));
    assert!(described["paths"]["/api/v1/jobs"]["post"].is_object(), "{described}");
}

#[tokio::test]
async fn every_request_has_a_name() {
    let (app, _folder) = idle().await;
    let named = [("x-request-id", "mine-1")];
    let answer = send_with(&app, "GET", "/jobs/job_1", "", &named).await;
    assert_eq!(answer.headers()["x-request-id"], "mine-1");
    assert_eq!(json_of(answer).await["request_id"], "mine-1");
    for bad in ["", "a b", &"x".repeat(65)] {
        let answer = send_with(&app, "GET", "/jobs", "", &[("x-request-id", bad)]).await;
        let name = answer.headers()["x-request-id"].to_str().unwrap();
        assert!(name.starts_with("req_") && name.len() < 64, "{name}");
    }
}

#[tokio::test]
async fn pages_of_allowed_origins_may_ask() {
    let folder = tempfile::tempdir().unwrap();
    let state = idle_in(folder.path()).await;
    let app = app(state.with_origins([HeaderValue::from_static("https://lab.example")]));
    let own = [("origin", "https://lab.example"), ("host", "localhost:8787")];
    let answer = send_with(&app, "POST", "/jobs", DATASET, &own).await;
    assert_eq!(answer.status(), StatusCode::CREATED);
    assert_eq!(answer.headers()["access-control-allow-origin"], "https://lab.example");
    let ask = [own[0], own[1], ("access-control-request-method", "POST")];
    let answer = send_with(&app, "OPTIONS", "/jobs", "", &ask).await;
    assert!(answer.status().is_success(), "{}", answer.status());
    let allowed = answer.headers()["access-control-allow-methods"].to_str().unwrap();
    assert!(allowed.contains("POST"), "{allowed}");
    // Its own name for our address.
    let rebound = [("origin", "http://evil.example:80"), ("host", "evil.example:80")];
    let answer = send_with(&app, "POST", "/jobs", DATASET, &rebound).await;
    assert_problem(answer, 403, "foreign_origin").await;
    let foreign = [("origin", "https://evil.example"), ("host", "localhost:8787")];
    let answer = send_with(&app, "POST", "/jobs", DATASET, &foreign).await;
    assert!(answer.headers().get("access-control-allow-origin").is_none());
    assert_problem(answer, 403, "foreign_origin").await;
}

async fn limited(limits: Limits) -> (Router, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    (app(idle_in(folder.path()).await.with_limits(limits)), folder)
}

#[tokio::test]
async fn a_full_house_takes_no_more() {
    let (app, _folder) = limited(Limits { queued: 1, ..Limits::default() }).await;
    let key = [("idempotency-key", "k")];
    let first = json_of(send_with(&app, "POST", "/jobs", DATASET, &key).await).await;
    let answer = send(&app, "POST", "/jobs", DATASET).await;
    assert_eq!(answer.headers()["retry-after"], "10");
    assert_problem(answer, 503, "queue_full").await;
    // Whoever did not hear the answer asks for the same.
    let again = json_of(send_with(&app, "POST", "/jobs", DATASET, &key).await).await;
    assert_eq!(first["id"], again["id"]);

    let (app, _folder) = limited(Limits { free_bytes: u64::MAX, ..Limits::default() }).await;
    assert_problem(send(&app, "POST", "/jobs", DATASET).await, 507, "disk_full").await;
    assert_problem(send(&app, "POST", "/meshes", "v 0 0 0").await, 507, "disk_full").await;

    let (app, _folder) = limited(Limits { kept_mesh_bytes: 0, ..Limits::default() }).await;
    assert_problem(send(&app, "POST", "/meshes", "v 0 0 0").await, 507, "meshes_full").await;
}

#[tokio::test]
async fn whoever_asks_too_often_waits() {
    let changes_per_second = NonZeroU32::new(3).unwrap();
    let (app, _folder) = limited(Limits { changes_per_second, ..Limits::default() }).await;
    let ask = async |address: [u8; 4]| {
        let from = ConnectInfo(SocketAddr::from((address, 1)));
        let request = Request::post("/api/v1/jobs/job_1/cancel").extension(from);
        app.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap()
    };
    for _ in 0..3 {
        assert_problem(ask([10, 0, 0, 1]).await, 404, "job_not_found").await;
    }
    let answer = ask([10, 0, 0, 1]).await;
    assert_eq!(answer.headers()["retry-after"], "1");
    assert_problem(answer, 429, "too_many_requests").await;
    assert_problem(ask([10, 0, 0, 2]).await, 404, "job_not_found").await;
}
