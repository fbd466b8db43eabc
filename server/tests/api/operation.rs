//! What operators and their programs ask.

use crate::{idle, json_of, send};
use axum::body::Body;
use axum::http::{Request, StatusCode};
use axum::response::Response;
use http_body_util::BodyExt;
use tower::ServiceExt;

async fn get(app: &axum::Router, path: &str) -> Response {
    let request = Request::get(path).body(Body::empty()).unwrap();
    let answer = app.clone().oneshot(request).await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK, "{path}");
    answer
}

#[tokio::test]
async fn a_server_says_how_it_is() {
    let (app, _folder) = idle().await;
    assert_eq!(json_of(get(&app, "/readyz").await).await["status"], "ready");
    let version = json_of(get(&app, "/version").await).await;
    assert_eq!(version["version"], env!("CARGO_PKG_VERSION"));
    let job = send(&app, "POST", "/jobs", r#"{"kind": "dataset.generate"}"#).await;
    assert_eq!(job.status(), StatusCode::CREATED);
    let metrics = get(&app, "/metrics").await.into_body().collect().await.unwrap().to_bytes();
    let metrics = String::from_utf8(metrics.to_vec()).unwrap();
    let queued = r#"ngf_jobs{kind="dataset.generate",status="queued"} 1"#;
    assert!(metrics.lines().any(|line| line == queued), "{metrics}");
}

#[tokio::test]
async fn the_description_is_served() {
    let (app, _folder) = idle().await;
    let described = json_of(get(&app, "/openapi.json").await).await;
    assert!(described["openapi"].as_str().unwrap().starts_with("3.1"));
    assert!(described["paths"]["/api/v1/jobs"]["post"].is_object(), "{described}");
}
