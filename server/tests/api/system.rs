//! Health, metrics, request ids, CORS, and quotas.

use crate::{assert_problem, json_of, send, send_with, test_app, test_state};
use axum::Router;
use axum::body::Body;
use axum::extract::ConnectInfo;
use axum::http::{HeaderValue, Request, StatusCode};
use axum::response::Response;
use http_body_util::BodyExt;
use server::{Quotas, app};
use std::net::SocketAddr;
use std::num::NonZeroU32;
use tempfile::TempDir;
use tower::ServiceExt;

async fn get(app: &Router, path: &str) -> Response {
    let request = Request::get(path).body(Body::empty()).unwrap();
    let response = app.clone().oneshot(request).await.unwrap();
    assert_eq!(response.status(), StatusCode::OK, "{path}");
    response
}

/// Metrics in the format that a client accepts.
async fn metrics(app: &Router, accept: &str) -> String {
    let request = Request::get("/metrics").header("accept", accept).body(Body::empty()).unwrap();
    let response = app.clone().oneshot(request).await.unwrap();
    let format = accept.split(';').next().unwrap();
    assert!(response.headers()["content-type"].to_str().unwrap().starts_with(format));
    let body = response.into_body().collect().await.unwrap();
    String::from_utf8(body.to_bytes().to_vec()).unwrap()
}

#[tokio::test]
async fn server_reports_readiness_version_and_metrics() {
    let (app, _folder) = test_app().await;
    assert_eq!(json_of(get(&app, "/readyz").await).await["status"], "ready");
    let version = json_of(get(&app, "/version").await).await;
    assert_eq!(version["version"], env!("CARGO_PKG_VERSION"));
    let job = send(&app, "POST", "/jobs", DATASET).await;
    assert_eq!(job.status(), StatusCode::CREATED);
    send(&app, "GET", "/jobs/job_1", "").await;
    send(&app, "GET", "/jobs/job_2", "").await;
    let text = metrics(&app, "application/openmetrics-text;version=1.0.0").await;
    for line in [
        r#"ngf_jobs{kind="dataset.generate",status="queued"} 1"#,
        r#"ngf_jobs{kind="policy.train",status="running"} 0"#,
        // One series for all jobs: the label is the route.
        r#"ngf_http_request_duration_seconds_count{method="GET",route="/api/v1/jobs/{id}",status="404"} 2"#,
        "ngf_sse_clients 0",
        "# EOF",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
    let text = metrics(&app, "text/plain").await;
    for line in [
        "# TYPE ngf_build_info gauge",
        "# TYPE ngf_upload_bytes_total counter",
        "ngf_upload_bytes_total 0",
        r#"ngf_jobs{kind="dataset.generate",status="queued"} 1"#,
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
    let types = ["counter", "gauge", "histogram"];
    let is_known = |line: &str| types.iter().any(|kind| line.ends_with(kind));
    assert!(text.lines().filter(|line| line.starts_with("# TYPE")).all(is_known), "{text}");
    assert!(!text.contains("# EOF") && !text.contains("# UNIT"), "{text}");
}

const DATASET: &str = r#"{"kind": "dataset.generate"}"#;

#[tokio::test]
async fn openapi_description_is_served() {
    let (app, _folder) = test_app().await;
    let openapi = json_of(get(&app, "/openapi.json").await).await;
    assert!(openapi["openapi"].as_str().unwrap().starts_with("3.1"));
    assert!(openapi["paths"]["/api/v1/jobs"]["post"].is_object(), "{openapi}");
}

#[tokio::test]
async fn every_response_has_a_request_id() {
    let (app, _folder) = test_app().await;
    let header = [("x-request-id", "mine-1")];
    let response = send_with(&app, "GET", "/jobs/job_1", "", &header).await;
    assert_eq!(response.headers()["x-request-id"], "mine-1");
    assert_eq!(json_of(response).await["request_id"], "mine-1");
    for invalid in ["", "a b", &"x".repeat(65)] {
        let response = send_with(&app, "GET", "/jobs", "", &[("x-request-id", invalid)]).await;
        let id = response.headers()["x-request-id"].to_str().unwrap();
        assert!(id.starts_with("req_") && id.len() < 64, "{id}");
    }
}

#[tokio::test]
async fn only_allowed_origins_may_write() {
    let folder = tempfile::tempdir().unwrap();
    let state = test_state(folder.path()).await;
    let app = app(state.with_origins([HeaderValue::from_static("https://lab.example")]));
    let allowed = [("origin", "https://lab.example"), ("host", "localhost:8787")];
    let response = send_with(&app, "POST", "/jobs", DATASET, &allowed).await;
    assert_eq!(response.status(), StatusCode::CREATED);
    assert_eq!(response.headers()["access-control-allow-origin"], "https://lab.example");
    let preflight = [allowed[0], allowed[1], ("access-control-request-method", "POST")];
    let response = send_with(&app, "OPTIONS", "/jobs", "", &preflight).await;
    assert!(response.status().is_success(), "{}", response.status());
    let methods = response.headers()["access-control-allow-methods"].to_str().unwrap();
    assert!(methods.contains("POST"), "{methods}");
    // DNS rebinding: a foreign name for the address of the server.
    let rebound = [("origin", "http://evil.example:80"), ("host", "evil.example:80")];
    let response = send_with(&app, "POST", "/jobs", DATASET, &rebound).await;
    assert_problem(response, 403, "host_not_allowed").await;
    let foreign = [("origin", "https://evil.example"), ("host", "localhost:8787")];
    let response = send_with(&app, "POST", "/jobs", DATASET, &foreign).await;
    assert!(response.headers().get("access-control-allow-origin").is_none());
    assert_problem(response, 403, "origin_not_allowed").await;
}

/// A server with these quotas, and its data folder.
async fn limited(limits: Quotas) -> (Router, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    (app(test_state(folder.path()).await.with_quotas(limits)), folder)
}

#[tokio::test]
async fn requests_are_rejected_when_a_quota_is_exhausted() {
    let (app, _folder) = limited(Quotas { max_queued: 1, ..Quotas::default() }).await;
    let key = [("idempotency-key", "k")];
    let first = json_of(send_with(&app, "POST", "/jobs", DATASET, &key).await).await;
    let response = send(&app, "POST", "/jobs", DATASET).await;
    assert_eq!(response.headers()["retry-after"], "10");
    assert_problem(response, 503, "queue_full").await;
    // A client that lost the first response repeats its request.
    let again = json_of(send_with(&app, "POST", "/jobs", DATASET, &key).await).await;
    assert_eq!(first["id"], again["id"]);

    let (app, _folder) = limited(Quotas { min_free_bytes: u64::MAX, ..Quotas::default() }).await;
    assert_problem(send(&app, "POST", "/jobs", DATASET).await, 507, "disk_full").await;
    assert_problem(send(&app, "POST", "/meshes", "v 0 0 0").await, 507, "disk_full").await;

    let (app, _folder) = limited(Quotas { max_total_mesh_bytes: 0, ..Quotas::default() }).await;
    assert_problem(send(&app, "POST", "/meshes", "v 0 0 0").await, 507, "mesh_quota_exceeded")
        .await;
}

#[tokio::test]
async fn client_is_rate_limited_when_it_writes_too_often() {
    let max_writes_per_second = NonZeroU32::new(3).unwrap();
    let limits = Quotas { max_writes_per_second, ..Quotas::default() };
    let (app, _folder) = limited(limits).await;
    let cancel_from = async |address: [u8; 4]| {
        let client = ConnectInfo(SocketAddr::from((address, 1)));
        let request = Request::post("/api/v1/jobs/job_1/cancel").extension(client);
        app.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap()
    };
    for _ in 0..3 {
        assert_problem(cancel_from([10, 0, 0, 1]).await, 404, "job_not_found").await;
    }
    let response = cancel_from([10, 0, 0, 1]).await;
    assert_eq!(response.headers()["retry-after"], "1");
    assert_problem(response, 429, "too_many_requests").await;
    assert_problem(cancel_from([10, 0, 0, 2]).await, 404, "job_not_found").await;
}
