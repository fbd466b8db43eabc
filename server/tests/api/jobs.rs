//! Job endpoints, with a scheduler that does not start jobs.

use crate::{assert_problem, create_job, json_of, send, send_with, test_app, test_state};
use axum::http::StatusCode;
use axum::response::Response;
use serde_json::{Value, json};
use server::{AppState, app};

#[tokio::test]
async fn job_contains_all_members_and_resolved_params() {
    let (app, _folder) = test_app().await;
    let id = create_job(&app, "first").await;
    let job = json_of(send(&app, "GET", &format!("/jobs/{id}"), "").await).await;
    assert_eq!(job["status"], "queued");
    assert_eq!(
        job["params"],
        json!({
            "preset": "small", "object": null, "mesh_id": null, "mass_kg": null,
            "density_kg_m3": null, "unit": null, "size_m": null, "scale": null, "up": null,
            "orientation": null, "point_clouds": false, "seed": 0, "threads": 0,
        })
    );
    let names: Vec<&String> = job.as_object().unwrap().keys().collect();
    assert_members(&names);
    for url in job["urls"].as_object().unwrap().values() {
        assert!(url.as_str().unwrap().starts_with('/'), "{url}");
    }
}

/// Asserts the members of a job.
fn assert_members(names: &[&String]) {
    let expected = [
        "attempt",
        "checkpoint_count",
        "created_at",
        "error",
        "estimated_finish_at",
        "finished_at",
        "id",
        "inputs",
        "kind",
        "latest_metrics",
        "metadata",
        "name",
        "object",
        "outputs",
        "params",
        "phase",
        "priority",
        "progress",
        "resumable",
        "seed",
        "started_at",
        "status",
        "updated_at",
        "urls",
        "worker",
    ];
    assert_eq!(names, &expected);
}

#[tokio::test]
async fn invalid_requests_are_rejected_with_the_parameter_name() {
    let (app, _folder) = test_app().await;
    let cases = [
        ("{", 400, "malformed_json", None),
        ("[]", 400, "malformed_json", None),
        // An array of the member values, which serde alone would accept.
        (r#"["dataset.generate", {"preset": "smoke"}]"#, 400, "malformed_json", None),
        (r#"{"kind": "dataset.make"}"#, 422, "invalid_parameter", Some("kind")),
        (
            r#"{"kind": "mesh.prepare", "kind": "dataset.generate"}"#,
            422,
            "invalid_parameter",
            Some("kind"),
        ),
        (
            r#"{"kind": "dataset.generate", "params": {"seed": 1, "seed": 2}}"#,
            422,
            "invalid_parameter",
            Some("seed"),
        ),
        (r#"{"kind": "dataset.generate", "param": {}}"#, 422, "invalid_parameter", Some("param")),
        (
            r#"{"kind": "dataset.generate", "params": {"seed": "x"}}"#,
            422,
            "invalid_parameter",
            Some("params.seed"),
        ),
        (
            r#"{"kind": "encoder.train", "params": {"dataset_id": "ds_none"}}"#,
            422,
            "input_not_found",
            Some("params.dataset_id"),
        ),
        (
            r#"{"kind": "policy.evaluate", "params": {"model_id": "../../etc", "object": "bleach"}}"#,
            422,
            "input_not_found",
            Some("params.model_id"),
        ),
        (
            r#"{"kind": "dataset.generate", "metadata": {"a": 1}}"#,
            422,
            "invalid_parameter",
            Some("metadata"),
        ),
    ];
    for (body, status, code, param) in cases {
        let response = send(&app, "POST", "/jobs", body).await;
        let problem = assert_problem(response, status, code).await;
        if let Some(param) = param {
            assert_eq!(problem["errors"][0]["param"], param, "{body}: {problem}");
        }
    }
    assert_problem(send(&app, "GET", "/jobs/job_none", "").await, 404, "job_not_found").await;
    assert_problem(send(&app, "GET", "/jobs?status=done", "").await, 422, "invalid_parameter")
        .await;
    assert_problem(send(&app, "GET", "/jobs?limit=0", "").await, 422, "invalid_parameter").await;
    assert_problem(send(&app, "POST", "/jobs/x/stop", "").await, 404, "unknown_action").await;
    assert_problem(send(&app, "GET", "/artifacts/00", "").await, 404, "record_not_found").await;
}

#[tokio::test]
async fn dry_run_returns_an_estimate_without_creating_a_job() {
    let (app, _folder) = test_app().await;
    let body = r#"{"kind": "dataset.generate", "params": {"preset": "smoke"}}"#;
    let response = json_of(send(&app, "POST", "/jobs?dry_run=true", body).await).await;
    assert_eq!((&response["id"], &response["params"]["preset"]), (&Value::Null, &json!("smoke")));
    let estimate = &response["estimate"];
    assert!(estimate["seconds"].as_f64().is_some_and(|seconds| seconds > 1.0), "{estimate}");
    assert!(estimate["bytes"].as_f64().is_some_and(|bytes| bytes > 1e6), "{estimate}");
    assert_eq!(json_of(send(&app, "GET", "/jobs", "").await).await["data"], json!([]));
}

#[tokio::test]
async fn idempotency_key_creates_one_job() {
    let (app, _folder) = test_app().await;
    let body = r#"{"kind": "dataset.generate"}"#;
    let key = [("idempotency-key", "k1")];
    let first = json_of(send_with(&app, "POST", "/jobs", body, &key).await).await;
    let again = json_of(send_with(&app, "POST", "/jobs", body, &key).await).await;
    assert_eq!(first["id"], again["id"]);
    let other = r#"{"kind": "dataset.generate", "name": "other"}"#;
    let response = send_with(&app, "POST", "/jobs", other, &key).await;
    assert_problem(response, 422, "idempotency_key_reused").await;
    // Concurrent requests with the same key.
    let key = [("idempotency-key", "k2")];
    let requests = (0..20).map(|_| send_with(&app, "POST", "/jobs", body, &key));
    let mut ids = Vec::new();
    for response in futures_util::future::join_all(requests).await {
        ids.push(json_of(response).await["id"].clone());
    }
    ids.dedup();
    assert_eq!(ids.len(), 1);
    let jobs = json_of(send(&app, "GET", "/jobs", "").await).await;
    assert_eq!(jobs["data"].as_array().unwrap().len(), 2);
}

#[tokio::test]
async fn job_list_is_paginated_and_filtered() {
    let (app, _folder) = test_app().await;
    let mut ids = Vec::new();
    for name in ["a", "b", "c", "d", "e"] {
        ids.push(create_job(&app, name).await);
    }
    let mut seen = Vec::new();
    let mut path = "/jobs?limit=2".to_owned();
    loop {
        let page = json_of(send(&app, "GET", &path, "").await).await;
        let of_page = page["data"].as_array().unwrap().iter();
        seen.extend(of_page.map(|job| job["id"].as_str().unwrap().to_owned()));
        if page["has_more"] == false {
            break;
        }
        path = format!("/jobs?limit=2&after={}", page["last_id"].as_str().unwrap());
    }
    seen.reverse();
    assert_eq!(seen, ids);
    let many = format!("/jobs?{}", "metadata[of]=c&".repeat(1000));
    assert_problem(send(&app, "GET", &many, "").await, 422, "invalid_parameter").await;
    let by_metadata = json_of(send(&app, "GET", "/jobs?metadata[of]=c", "").await).await;
    assert_eq!(by_metadata["data"][0]["id"], ids[2].as_str());
    assert_eq!(by_metadata["data"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn queued_job_can_be_cancelled_paused_resumed_patched_cloned_and_deleted() {
    let (app, _folder) = test_app().await;
    let id = create_job(&app, "x").await;
    let act = async |action: &str| send(&app, "POST", &format!("/jobs/{id}/{action}"), "").await;
    let status = async |response: Response| json_of(response).await["status"].clone();
    for query in ["dry_run=1", "dryrun=true"] {
        let body = r#"{"kind": "dataset.generate"}"#;
        let invalid = send(&app, "POST", &format!("/jobs?{query}"), body).await;
        assert_problem(invalid, 422, "invalid_parameter").await;
    }
    assert_eq!(status(act("pause").await).await, "paused");
    assert_eq!(status(act("pause").await).await, "paused", "pausing is idempotent");
    assert_problem(act("retry").await, 409, "invalid_state").await;
    assert_eq!(status(act("resume").await).await, "queued");
    let response = send(&app, "DELETE", &format!("/jobs/{id}"), "").await;
    assert_problem(response, 409, "invalid_state").await;
    assert_eq!(status(act("cancel").await).await, "cancelled");
    assert_eq!(status(act("cancel").await).await, "cancelled");
    assert_problem(act("pause").await, 409, "invalid_state").await;
    let patch = send(&app, "PATCH", &format!("/jobs/{id}"), r#"{"priority": 3}"#).await;
    assert_problem(patch, 409, "invalid_state").await;
    let patch = send(&app, "PATCH", &format!("/jobs/{id}"), "[]").await;
    assert_problem(patch, 400, "malformed_json").await;
    let patch = send(&app, "PATCH", &format!("/jobs/{id}"), r#"{"name": "better"}"#).await;
    assert_eq!(json_of(patch).await["name"], "better");
    let both = r#"{"name": "passing", "metadata": {"for": "a test"}}"#;
    let patch = json_of(send(&app, "PATCH", &format!("/jobs/{id}"), both).await).await;
    assert_eq!((&patch["name"], &patch["metadata"]["for"]), (&"passing".into(), &"a test".into()));
    // An absent member is not changed; null removes it.
    let patch = send(&app, "PATCH", &format!("/jobs/{id}"), r#"{"metadata": null}"#).await;
    let patch = json_of(patch).await;
    assert_eq!((&patch["name"], &patch["metadata"]), (&"passing".into(), &json!({})));
    let patch = send(&app, "PATCH", &format!("/jobs/{id}"), r#"{"name": null}"#).await;
    assert!(json_of(patch).await["name"].is_null());
    let patch = send(&app, "PATCH", &format!("/jobs/{id}"), r#"{"name": "better"}"#).await;
    assert_eq!(json_of(patch).await["name"], "better");
    let copy = json_of(act("clone").await).await;
    assert!(copy["id"] != id.as_str() && copy["name"] == "better");
    let events = json_of(send(&app, "GET", &format!("/jobs/{id}/events"), "").await).await;
    let events = events["data"].as_array().unwrap().iter();
    let statuses: Vec<&str> =
        events.map(|event| event["data"]["status"].as_str().unwrap()).collect();
    assert_eq!(statuses, ["queued", "paused", "queued", "cancelled"]);
    // The job has finished and no event follows this id.
    let stream = send(&app, "GET", &format!("/jobs/{id}/stream?after=1000000"), "").await;
    assert_eq!(stream.status(), StatusCode::NO_CONTENT);
    let response = send(&app, "DELETE", &format!("/jobs/{id}"), "").await;
    assert_eq!(response.status(), StatusCode::NO_CONTENT);
    assert_problem(send(&app, "GET", &format!("/jobs/{id}"), "").await, 404, "job_not_found").await;
}

#[tokio::test]
async fn worker_report_without_its_token_is_rejected() {
    let (app, _folder) = test_app().await;
    let id = create_job(&app, "x").await;
    let path = format!("/jobs/{id}/reports");
    assert_problem(send(&app, "POST", &path, "{}").await, 409, "stale_worker").await;
    let token = [("authorization", "Bearer 0123")];
    let response = send_with(&app, "POST", &path, r#"{"completion": "succeeded"}"#, &token).await;
    assert_problem(response, 409, "stale_worker").await;
    let job = json_of(send(&app, "GET", &format!("/jobs/{id}"), "").await).await;
    assert_eq!(job["status"], "queued");
}

#[tokio::test]
async fn job_is_not_modified_when_its_etag_matches() {
    let (app, _folder) = test_app().await;
    let path = format!("/jobs/{}", create_job(&app, "x").await);
    let tag = send(&app, "GET", &path, "").await.headers()["etag"].to_str().unwrap().to_owned();
    for etag in [tag.clone(), format!("W/{tag}"), format!("\"0\", {tag}"), "*".into()] {
        for path in [path.clone(), format!("{path}?wait=0.1s")] {
            let response = send_with(&app, "GET", &path, "", &[("if-none-match", &etag)]).await;
            assert_eq!(response.status(), StatusCode::NOT_MODIFIED, "{etag}");
        }
    }
    let other = [("if-none-match", "\"another\"")];
    assert_eq!(send_with(&app, "GET", &path, "", &other).await.status(), StatusCode::OK);
}

#[tokio::test]
async fn waiting_request_returns_when_the_job_changes() {
    let (app, _folder) = test_app().await;
    let id = create_job(&app, "x").await;
    let path = format!("/jobs/{id}?wait=20s");
    let waiting = send(&app, "GET", &path, "");
    let cancelling = async {
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        send(&app, "POST", &format!("/jobs/{id}/cancel"), "").await
    };
    let started = std::time::Instant::now();
    let (response, _) = futures_util::future::join(waiting, cancelling).await;
    assert_eq!(json_of(response).await["status"], "cancelled");
    assert!(started.elapsed().as_secs() < 10);
}

#[tokio::test]
async fn range_of_an_empty_log_is_ignored() {
    let (app, _folder) = test_app().await;
    let log = format!("/jobs/{}/logs", create_job(&app, "x").await);
    for range in ["bytes=0-", "bytes=-5", "bytes=0-0"] {
        let response = send_with(&app, "GET", &log, "", &[("range", range)]).await;
        assert_eq!(response.status(), StatusCode::OK, "{range}");
        assert_eq!(response.headers()["content-length"], "0", "{range}");
    }
}

#[tokio::test]
async fn restart_deletes_folders_of_deleted_jobs_and_incomplete_artifacts() {
    let folder = tempfile::tempdir().unwrap();
    let artifacts = folder.path().join("data/artifacts");
    let job_dir = |id: &str| folder.path().join("data/work").join(id);
    let id = {
        let app = app(test_state(folder.path()).await);
        let id = create_job(&app, "x").await;
        for id in [&id, "job_gone"] {
            std::fs::create_dir_all(job_dir(id).join("out")).unwrap();
        }
        std::fs::create_dir_all(artifacts.join("ab")).unwrap();
        for name in ["ab12", "ab12#1"] {
            std::fs::write(artifacts.join("ab").join(name), "x").unwrap();
        }
        id
    };
    test_state(folder.path()).await;
    assert!(job_dir(&id).exists() && !job_dir("job_gone").exists());
    assert!(artifacts.join("ab/ab12").exists() && !artifacts.join("ab/ab12#1").exists());
}

#[tokio::test]
async fn jobs_are_disabled_without_a_data_folder() {
    let folder = tempfile::tempdir().unwrap();
    let app = app(AppState::new(folder.path(), folder.path()));
    assert_problem(send(&app, "GET", "/jobs", "").await, 404, "jobs_disabled").await;
    let api = json_of(send(&app, "GET", "", "").await).await;
    assert_eq!(api["jobs_enabled"], false);
}

#[tokio::test]
async fn all_write_endpoints_require_the_token_and_an_allowed_origin() {
    let folder = tempfile::tempdir().unwrap();
    let app = app(test_state(folder.path()).await.with_token("0123456789abcdef"));
    let openapi = serde_json::to_value(server::openapi()).unwrap();
    let mut writes = Vec::new();
    for (path, item) in openapi["paths"].as_object().unwrap() {
        // Endpoints for operators are outside of /api/v1 and read-only.
        let Some(inner) = path.strip_prefix("/api/v1/") else {
            assert_eq!(item.as_object().unwrap().keys().collect::<Vec<_>>(), ["get"], "{path}");
            continue;
        };
        let path = format!("/{inner}").replace("{action}", "cancel");
        let path = path.replace(['{', '}'], "");
        // Workers have their own tokens; see the test of reports.
        for method in ["post", "put", "patch", "delete"] {
            if item[method].is_object() && !path.ends_with("/reports") {
                writes.push((method.to_uppercase(), path.clone()));
            }
        }
    }
    assert!(writes.len() >= 6, "{writes:?}");
    for (method, path) in writes {
        for token in [None, Some("Bearer wrong"), Some("0123456789abcdef")] {
            let headers: Vec<_> = token.map(|token| ("authorization", token)).into_iter().collect();
            let response = send_with(&app, &method, &path, "{}", &headers).await;
            assert_eq!(response.headers()["www-authenticate"], "Bearer", "{method} {path}");
            assert_problem(response, 401, "unauthorized").await;
        }
        let headers = [("authorization", "Bearer 0123456789abcdef")];
        let response = send_with(&app, &method, &path, "{}", &headers).await;
        assert_ne!(response.status(), StatusCode::UNAUTHORIZED, "{method} {path}");
        let headers = [headers[0], ("host", "here:8787"), ("origin", "http://evil.example")];
        let response = send_with(&app, &method, &path, "{}", &headers).await;
        assert_problem(response, 403, "origin_not_allowed").await;
    }
    assert_eq!(send(&app, "GET", "/jobs", "").await.status(), StatusCode::OK);
}
