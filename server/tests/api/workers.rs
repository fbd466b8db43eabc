//! Failures of workers and of the disk.

use crate::{assert_problem, create_job, json_of, send, state_with_scheduler};
use serde_json::Value;
use server::app;

#[tokio::test]
async fn job_fails_when_its_worker_always_crashes() {
    let folder = tempfile::tempdir().unwrap();
    // Exits immediately, without a report.
    let (state, scheduler) = state_with_scheduler(folder.path(), "false".into(), 0).await;
    let app = app(state);
    let running = tokio::spawn(scheduler.run("http://127.0.0.1:9"));
    let id = create_job(&app, "x").await;
    let mut job = Value::Null;
    for _ in 0..200 {
        job = json_of(send(&app, "GET", &format!("/jobs/{id}?wait=1s"), "").await).await;
        if job["status"] == "failed" {
            break;
        }
    }
    running.abort();
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
async fn running_job_gets_an_alert_when_disk_space_is_low() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    // Runs for a minute, with any arguments.
    let program = folder.path().join("worker");
    std::fs::write(&program, "#!/bin/sh\nexec sleep 60\n").unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let (state, scheduler) = state_with_scheduler(folder.path(), program, u64::MAX).await;
    let app = app(state);
    let id = create_job(&app, "x").await;
    let running = tokio::spawn(scheduler.clone().run("http://127.0.0.1:9"));
    let mut alerts = Value::Null;
    for _ in 0..200 {
        let path = format!("/jobs/{id}/events?type=alert");
        alerts = json_of(send(&app, "GET", &path, "").await).await["data"].take();
        if alerts[0].is_object() {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    }
    running.abort();
    scheduler.shutdown().await;
    assert_eq!(alerts.as_array().unwrap().len(), 1, "{alerts}");
    assert_eq!(alerts[0]["data"]["code"], "disk_low", "{alerts}");
    assert!(alerts[0]["message"].as_str().unwrap().starts_with("only "), "{alerts}");
}
