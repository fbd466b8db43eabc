//! Jobs whose programs or disk go wrong.

use crate::{ask, assert_problem, json_of, send, working_with};
use serde_json::Value;
use server::app;

#[tokio::test]
async fn a_program_that_always_crashes_is_given_up() {
    let folder = tempfile::tempdir().unwrap();
    // Ends at once, and says nothing.
    let (state, engine) = working_with(folder.path(), "false".into(), 0).await;
    let app = app(state);
    let working = tokio::spawn(engine.work("http://127.0.0.1:9"));
    let id = ask(&app, "x").await;
    let mut job = Value::Null;
    for _ in 0..200 {
        job = json_of(send(&app, "GET", &format!("/jobs/{id}?wait=1s"), "").await).await;
        if job["status"] == "failed" {
            break;
        }
    }
    working.abort();
    assert_eq!(job["error"]["code"], "worker_lost", "{job}");
    assert_eq!(job["attempt"], 6);
    assert_eq!(job["resumable"], true);
    let events = format!("/jobs/{id}/events");
    let alerts = json_of(send(&app, "GET", &format!("{events}?type=alert"), "").await).await;
    let alerts = alerts["data"].as_array().unwrap();
    assert_eq!(alerts.len(), 6);
    assert!(alerts.iter().all(|alert| alert["type"] == "alert" && alert["level"] == "warn"));
    let problem = send(&app, "GET", &format!("{events}?type=news"), "").await;
    assert_problem(problem, 422, "invalid_parameter").await;
}

#[tokio::test]
#[cfg(unix)]
async fn of_a_disk_that_fills_up_those_are_told_whose_jobs_run() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    // Works for a while, whatever it is told.
    let program = folder.path().join("works");
    std::fs::write(&program, "#!/bin/sh\nexec sleep 60\n").unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let (state, engine) = working_with(folder.path(), program, u64::MAX).await;
    let app = app(state);
    let id = ask(&app, "x").await;
    let working = tokio::spawn(engine.clone().work("http://127.0.0.1:9"));
    let mut alerts = Value::Null;
    for _ in 0..200 {
        let path = format!("/jobs/{id}/events?type=alert");
        alerts = json_of(send(&app, "GET", &path, "").await).await["data"].take();
        if alerts[0].is_object() {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    }
    working.abort();
    engine.rest().await;
    assert_eq!(alerts.as_array().unwrap().len(), 1, "{alerts}");
    assert_eq!(alerts[0]["data"]["code"], "disk_low", "{alerts}");
    assert!(alerts[0]["message"].as_str().unwrap().starts_with("the disk has "), "{alerts}");
}
