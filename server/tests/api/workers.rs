//! Failures of workers and of the disk.

use crate::{assert_problem, config, create_job, json_of, send, state_with, state_with_scheduler};
use serde_json::Value;
use server::app;
use server::scheduler::SchedulerConfig;

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

/// Writes a program that runs for a minute, with any arguments.
#[cfg(unix)]
fn write_worker(path: &std::path::Path) {
    use std::os::unix::fs::PermissionsExt;
    let unfinished = path.with_extension("part");
    std::fs::write(&unfinished, "#!/bin/sh\nexec sleep 60\n").unwrap();
    std::fs::set_permissions(&unfinished, std::fs::Permissions::from_mode(0o755)).unwrap();
    std::fs::rename(unfinished, path).unwrap();
}

#[tokio::test]
#[cfg(unix)]
async fn jobs_wait_for_a_worker_executable_that_is_being_built() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("worker");
    let config =
        SchedulerConfig { waits_for_program: true, ..config(folder.path(), program.clone()) };
    let (state, scheduler) = state_with(folder.path(), config).await;
    let app = app(state);
    let id = create_job(&app, "x").await;
    let running = tokio::spawn(scheduler.clone().run("http://127.0.0.1:9"));
    let is_ready = async || json_of(send(&app, "GET", "", "").await).await["jobs_ready"].clone();
    let status = async || {
        json_of(send(&app, "GET", &format!("/jobs/{id}"), "").await).await["status"].clone()
    };
    // Longer than the interval of the scheduler.
    tokio::time::sleep(std::time::Duration::from_secs(1)).await;
    assert_eq!((is_ready().await, status().await), (false.into(), "queued".into()));
    write_worker(&program);
    assert_eq!(is_ready().await, true);
    let mut started = false;
    for _ in 0..200 {
        started = status().await == "running";
        if started {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    }
    running.abort();
    scheduler.shutdown().await;
    assert!(started, "{}", status().await);
}

#[tokio::test]
#[cfg(unix)]
async fn running_job_gets_an_alert_when_disk_space_is_low() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("worker");
    write_worker(&program);
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
