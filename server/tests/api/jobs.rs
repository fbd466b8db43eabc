//! Jobs by request and answer, while nobody works on them.

use crate::{ask, assert_problem, idle, idle_in, json_of, send, send_with};
use axum::http::StatusCode;
use axum::response::Response;
use serde_json::{Value, json};
use server::{AppState, app};

#[tokio::test]
async fn a_job_says_all_that_was_decided() {
    let (app, _folder) = idle().await;
    let id = ask(&app, "first").await;
    let job = json_of(send(&app, "GET", &format!("/jobs/{id}"), "").await).await;
    assert_eq!(job["status"], "queued");
    assert_eq!(
        job["params"],
        json!({
            "preset": "small", "object": null, "mesh_id": null, "mass_kg": null,
            "density_kg_m3": null, "seed": 0, "threads": 0,
        })
    );
    let names: Vec<&String> = job.as_object().unwrap().keys().collect();
    assert_members(&names);
    for url in job["urls"].as_object().unwrap().values() {
        assert!(url.as_str().unwrap().starts_with('/'), "{url}");
    }
}

/// The members of a job, as the documentation lists them.
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
async fn what_is_asked_wrongly_is_refused_by_name() {
    let (app, _folder) = idle().await;
    let cases = [
        ("{", 400, "malformed_json", None),
        ("[]", 400, "malformed_json", None),
        // The fields of a request in their order, which serde would take.
        (r#"["dataset.generate", {"preset": "smoke"}]"#, 400, "malformed_json", None),
        (r#"{"kind": "dataset.make"}"#, 422, "invalid_parameter", Some("kind")),
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
        let answer = send(&app, "POST", "/jobs", body).await;
        let problem = assert_problem(answer, status, code).await;
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
async fn a_dry_run_answers_and_does_nothing() {
    let (app, _folder) = idle().await;
    let body = r#"{"kind": "dataset.generate", "params": {"preset": "smoke"}}"#;
    let answer = json_of(send(&app, "POST", "/jobs?dry_run=true", body).await).await;
    assert_eq!((&answer["id"], &answer["params"]["preset"]), (&Value::Null, &json!("smoke")));
    let estimate = &answer["estimate"];
    assert!(estimate["seconds"].as_f64().is_some_and(|seconds| seconds > 1.0), "{estimate}");
    assert!(estimate["bytes"].as_f64().is_some_and(|bytes| bytes > 1e6), "{estimate}");
    assert_eq!(json_of(send(&app, "GET", "/jobs", "").await).await["data"], json!([]));
}

#[tokio::test]
async fn a_key_asks_once() {
    let (app, _folder) = idle().await;
    let body = r#"{"kind": "dataset.generate"}"#;
    let key = [("idempotency-key", "k1")];
    let first = json_of(send_with(&app, "POST", "/jobs", body, &key).await).await;
    let again = json_of(send_with(&app, "POST", "/jobs", body, &key).await).await;
    assert_eq!(first["id"], again["id"]);
    let other = r#"{"kind": "dataset.generate", "name": "other"}"#;
    let answer = send_with(&app, "POST", "/jobs", other, &key).await;
    assert_problem(answer, 422, "idempotency_key_reused").await;
    // At once, and as often as one likes.
    let key = [("idempotency-key", "k2")];
    let asked = (0..20).map(|_| send_with(&app, "POST", "/jobs", body, &key));
    let mut ids = Vec::new();
    for answer in futures_util::future::join_all(asked).await {
        ids.push(json_of(answer).await["id"].clone());
    }
    ids.dedup();
    assert_eq!(ids.len(), 1);
    let jobs = json_of(send(&app, "GET", "/jobs", "").await).await;
    assert_eq!(jobs["data"].as_array().unwrap().len(), 2);
}

#[tokio::test]
async fn lists_are_read_page_by_page() {
    let (app, _folder) = idle().await;
    let mut ids = Vec::new();
    for name in ["a", "b", "c", "d", "e"] {
        ids.push(ask(&app, name).await);
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
async fn what_waits_is_cancelled_paused_tried_again_and_deleted() {
    let (app, _folder) = idle().await;
    let id = ask(&app, "x").await;
    let act = async |verb: &str| send(&app, "POST", &format!("/jobs/{id}/{verb}"), "").await;
    let status = async |answer: Response| json_of(answer).await["status"].clone();
    for query in ["dry_run=1", "dryrun=true"] {
        let body = r#"{"kind": "dataset.generate"}"#;
        let unclear = send(&app, "POST", &format!("/jobs?{query}"), body).await;
        assert_problem(unclear, 422, "invalid_parameter").await;
    }
    assert_eq!(status(act("pause").await).await, "paused");
    assert_eq!(status(act("pause").await).await, "paused", "again does no harm");
    assert_problem(act("retry").await, 409, "invalid_state").await;
    assert_eq!(status(act("resume").await).await, "queued");
    let answer = send(&app, "DELETE", &format!("/jobs/{id}"), "").await;
    assert_problem(answer, 409, "invalid_state").await;
    assert_eq!(status(act("cancel").await).await, "cancelled");
    assert_eq!(status(act("cancel").await).await, "cancelled");
    assert_problem(act("pause").await, 409, "invalid_state").await;
    let patch = send(&app, "PATCH", &format!("/jobs/{id}"), r#"{"priority": 3}"#).await;
    assert_problem(patch, 409, "invalid_state").await;
    let patch = send(&app, "PATCH", &format!("/jobs/{id}"), "[]").await;
    assert_problem(patch, 400, "malformed_json").await;
    let patch = send(&app, "PATCH", &format!("/jobs/{id}"), r#"{"name": "better"}"#).await;
    assert_eq!(json_of(patch).await["name"], "better");
    let about = r#"{"name": "passing", "metadata": {"for": "a test"}}"#;
    let patch = json_of(send(&app, "PATCH", &format!("/jobs/{id}"), about).await).await;
    assert_eq!((&patch["name"], &patch["metadata"]["for"]), (&"passing".into(), &"a test".into()));
    // What is left out stays, null takes away.
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
    let told: Vec<&str> = events.map(|event| event["data"]["status"].as_str().unwrap()).collect();
    assert_eq!(told, ["queued", "paused", "queued", "cancelled"]);
    // All of it is read, and nothing will come.
    let stream = send(&app, "GET", &format!("/jobs/{id}/stream?after=1000000"), "").await;
    assert_eq!(stream.status(), StatusCode::NO_CONTENT);
    let answer = send(&app, "DELETE", &format!("/jobs/{id}"), "").await;
    assert_eq!(answer.status(), StatusCode::NO_CONTENT);
    assert_problem(send(&app, "GET", &format!("/jobs/{id}"), "").await, 404, "job_not_found").await;
}

#[tokio::test]
async fn a_report_without_its_token_is_refused() {
    let (app, _folder) = idle().await;
    let id = ask(&app, "x").await;
    let path = format!("/jobs/{id}/reports");
    assert_problem(send(&app, "POST", &path, "{}").await, 409, "not_its_turn").await;
    let token = [("authorization", "Bearer 0123")];
    let answer = send_with(&app, "POST", &path, r#"{"ended": "done"}"#, &token).await;
    assert_problem(answer, 409, "not_its_turn").await;
    let job = json_of(send(&app, "GET", &format!("/jobs/{id}"), "").await).await;
    assert_eq!(job["status"], "queued");
}

#[tokio::test]
async fn who_has_a_job_as_it_is_needs_nothing() {
    let (app, _folder) = idle().await;
    let path = format!("/jobs/{}", ask(&app, "x").await);
    let tag = send(&app, "GET", &path, "").await.headers()["etag"].to_str().unwrap().to_owned();
    for known in [tag.clone(), format!("W/{tag}"), format!("\"0\", {tag}"), "*".into()] {
        for path in [path.clone(), format!("{path}?wait=0.1s")] {
            let answer = send_with(&app, "GET", &path, "", &[("if-none-match", &known)]).await;
            assert_eq!(answer.status(), StatusCode::NOT_MODIFIED, "{known}");
        }
    }
    let other = [("if-none-match", "\"another\"")];
    assert_eq!(send_with(&app, "GET", &path, "", &other).await.status(), StatusCode::OK);
}

#[tokio::test]
async fn whoever_waits_is_told_of_a_change() {
    let (app, _folder) = idle().await;
    let id = ask(&app, "x").await;
    let path = format!("/jobs/{id}?wait=20s");
    let waiting = send(&app, "GET", &path, "");
    let cancelling = async {
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        send(&app, "POST", &format!("/jobs/{id}/cancel"), "").await
    };
    let began = std::time::Instant::now();
    let (told, _) = futures_util::future::join(waiting, cancelling).await;
    assert_eq!(json_of(told).await["status"], "cancelled");
    assert!(began.elapsed().as_secs() < 10);
}

#[tokio::test]
async fn a_log_that_is_empty_has_no_parts() {
    let (app, _folder) = idle().await;
    let log = format!("/jobs/{}/logs", ask(&app, "x").await);
    for range in ["bytes=0-", "bytes=-5", "bytes=0-0"] {
        let answer = send_with(&app, "GET", &log, "", &[("range", range)]).await;
        assert_eq!(answer.status(), StatusCode::OK, "{range}");
        assert_eq!(answer.headers()["content-length"], "0", "{range}");
    }
}

#[tokio::test]
async fn what_was_being_forgotten_when_the_server_ended_is_forgotten() {
    let folder = tempfile::tempdir().unwrap();
    let of_job = |id: &str| folder.path().join("data/work").join(id);
    let id = {
        let app = app(idle_in(folder.path()).await);
        let id = ask(&app, "x").await;
        for id in [&id, "job_gone"] {
            std::fs::create_dir_all(of_job(id).join("out")).unwrap();
        }
        id
    };
    idle_in(folder.path()).await;
    assert!(of_job(&id).exists() && !of_job("job_gone").exists());
}

#[tokio::test]
async fn a_server_without_a_folder_says_how_to_start_one() {
    let folder = tempfile::tempdir().unwrap();
    let app = app(AppState::new(folder.path(), folder.path()));
    assert_problem(send(&app, "GET", "/jobs", "").await, 404, "jobs_disabled").await;
    let api = json_of(send(&app, "GET", "", "").await).await;
    assert_eq!(api["jobs_enabled"], false);
}

#[tokio::test]
async fn changes_need_the_token_and_no_foreign_page() {
    let folder = tempfile::tempdir().unwrap();
    let app = app(idle_in(folder.path()).await.with_token("0123456789abcdef"));
    let described = serde_json::to_value(server::openapi()).unwrap();
    let mut changes = Vec::new();
    for (path, item) in described["paths"].as_object().unwrap() {
        // What operators ask lies elsewhere, and changes nothing.
        let Some(inner) = path.strip_prefix("/api/v1/") else {
            assert_eq!(item.as_object().unwrap().keys().collect::<Vec<_>>(), ["get"], "{path}");
            continue;
        };
        let path = format!("/{inner}").replace("{verb}", "cancel");
        let path = path.replace(['{', '}'], "");
        // A job's process has a token of its own: see below.
        for method in ["post", "put", "patch", "delete"] {
            if item[method].is_object() && !path.ends_with("/reports") {
                changes.push((method.to_uppercase(), path.clone()));
            }
        }
    }
    assert!(changes.len() >= 6, "{changes:?}");
    for (method, path) in changes {
        for token in [None, Some("Bearer wrong"), Some("0123456789abcdef")] {
            let headers: Vec<_> = token.map(|token| ("authorization", token)).into_iter().collect();
            let answer = send_with(&app, &method, &path, "{}", &headers).await;
            assert_eq!(answer.headers()["www-authenticate"], "Bearer", "{method} {path}");
            assert_problem(answer, 401, "unauthorized").await;
        }
        let headers = [("authorization", "Bearer 0123456789abcdef")];
        let answer = send_with(&app, &method, &path, "{}", &headers).await;
        assert_ne!(answer.status(), StatusCode::UNAUTHORIZED, "{method} {path}");
        let headers = [headers[0], ("host", "here:8787"), ("origin", "http://evil.example")];
        let answer = send_with(&app, &method, &path, "{}", &headers).await;
        assert_problem(answer, 403, "foreign_origin").await;
    }
    assert_eq!(send(&app, "GET", "/jobs", "").await.status(), StatusCode::OK);
}
