//! Behaviour that clients rely on: conditional changes, hints, the text of event streams.

use crate::{assert_problem, create_job, json_of, send, send_with, test_app};
use axum::http::StatusCode;
use http_body_util::BodyExt;
use serde_json::json;

#[tokio::test]
async fn change_is_rejected_when_its_if_match_is_outdated() {
    let (app, _folder) = test_app().await;
    let path = format!("/jobs/{}", create_job(&app, "x").await);
    let tag = send(&app, "GET", &path, "").await.headers()["etag"].to_str().unwrap().to_owned();
    let patch = async |name: &str, tag: &str| {
        let body = json!({ "name": name }).to_string();
        send_with(&app, "PATCH", &path, body, &[("if-match", tag)]).await
    };
    let changed = patch("a", &tag).await;
    assert_eq!(changed.status(), StatusCode::OK);
    let next = changed.headers()["etag"].to_str().unwrap().to_owned();
    assert_problem(patch("b", &tag).await, 412, "precondition_failed").await;
    assert_eq!(json_of(send(&app, "GET", &path, "").await).await["name"], "a");
    assert_eq!(patch("c", &next).await.status(), StatusCode::OK);
    assert_eq!(patch("d", "*").await.status(), StatusCode::OK);
    send(&app, "POST", &format!("{path}/cancel"), "").await;
    let delete = send_with(&app, "DELETE", &path, "", &[("if-match", &tag)]).await;
    assert_problem(delete, 412, "precondition_failed").await;
}

#[tokio::test]
async fn repeated_or_unknown_query_parameters_are_rejected() {
    let (app, _folder) = test_app().await;
    let job = create_job(&app, "x").await;
    let body = r#"{"kind": "dataset.generate"}"#;
    for (method, path, param) in [
        ("POST", "/meshes?size=0.12".to_owned(), "size"),
        ("POST", "/meshes?size_m=0.1&size_m=0.2".to_owned(), "size_m"),
        ("POST", "/jobs?dry_run=true&dry_run=false".to_owned(), "dry_run"),
        ("POST", "/jobs?dryrun=true".to_owned(), "dryrun"),
        ("GET", "/meshes?page=2".to_owned(), "page"),
        ("GET", "/datasets?limit=1&limit=2".to_owned(), "limit"),
        ("GET", "/models?kind=encoder".to_owned(), "kind"),
        ("GET", format!("/jobs/{job}?waits=1s"), "waits"),
        ("GET", format!("/jobs/{job}/metrics?key=loss"), "key"),
        ("GET", format!("/jobs/{job}/logs?lines=3"), "lines"),
        ("GET", format!("/jobs/{job}/events?kind=alert"), "kind"),
    ] {
        let response = send(&app, method, &path, if method == "POST" { body } else { "" }).await;
        let problem = assert_problem(response, 422, "invalid_parameter").await;
        assert_eq!(problem["errors"][0]["param"], param, "{path}: {problem}");
    }
    // Only the request that creates a job has made one.
    assert_eq!(
        json_of(send(&app, "GET", "/jobs", "").await).await["data"].as_array().unwrap().len(),
        1
    );
}

#[tokio::test]
async fn hints_of_missing_resources_name_existing_lists() {
    let (app, _folder) = test_app().await;
    for path in ["/meshes/x", "/datasets/x"] {
        let problem =
            assert_problem(send(&app, "GET", path, "").await, 404, "record_not_found").await;
        let list = problem["hint"].as_str().unwrap().split(' ').nth(1).unwrap().to_owned();
        let list = list.strip_prefix("/api/v1").unwrap();
        assert_eq!(send(&app, "GET", list, "").await.status(), StatusCode::OK, "{problem}");
    }
    let problem = json_of(send(&app, "GET", "/artifacts/00", "").await).await;
    assert!(problem["hint"].as_str().unwrap().contains("/jobs/{id}/artifacts"), "{problem}");
}

#[tokio::test]
async fn event_stream_starts_with_a_comment_and_its_first_event_sets_the_retry_time() {
    let (app, _folder) = test_app().await;
    let id = create_job(&app, "x").await;
    send(&app, "POST", &format!("/jobs/{id}/cancel"), "").await;
    let stream = send(&app, "GET", &format!("/jobs/{id}/stream"), "").await;
    assert_eq!(stream.headers()["content-type"], "text/event-stream");
    let bytes = stream.into_body().collect().await.unwrap().to_bytes();
    let text = String::from_utf8(bytes.to_vec()).unwrap();
    let blocks: Vec<&str> = text.split_terminator("\n\n").collect();
    assert!(
        blocks[0].starts_with(": events\nretry: 2000\nid: 1\nevent: status\ndata: {"),
        "{text}"
    );
    assert!(blocks[1].starts_with("id: 2\nevent: status\n"), "{text}");
    assert_eq!(blocks[2..], ["event: done\ndata: {}"]);
}
