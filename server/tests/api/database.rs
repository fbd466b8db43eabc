//! Databases of other versions, and damaged ones.

use crate::{assert_problem, create_job, json_of, send, test_state};
use axum::http::StatusCode;
use serde_json::{Value, json};
use server::app;
use server::scheduler::{JobScheduler, SchedulerConfig};
use sqlx::Connection;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use std::path::Path;

/// Executes statements in the database of a stopped server.
async fn execute(folder: &Path, statements: &'static str) {
    let file = folder.join("data/ngf.sqlite");
    std::fs::create_dir_all(file.parent().unwrap()).unwrap();
    let options = SqliteConnectOptions::new().filename(file).create_if_missing(true);
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    sqlx::raw_sql(statements).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}

/// Error of a server start.
async fn start_error(folder: &Path) -> String {
    let config = SchedulerConfig {
        data_dir: folder.join("data"),
        models_dir: folder.join("models"),
        program: "ngf".into(),
        waits_for_program: false,
        max_concurrent: 0,
        min_free_bytes: 0,
    };
    JobScheduler::open(config).await.expect_err("the server starts").to_string()
}

/// Tables of version 0.1, which had no migrations, with a job and an evaluation.
const VERSION_0_1: &str = include_str!("../../migrations/0001_tables.sql");

#[tokio::test]
async fn database_of_the_first_version_is_updated() {
    let folder = tempfile::tempdir().unwrap();
    let id = create_job(&app(test_state(folder.path()).await), "x").await;
    // Back to the state of the first version.
    execute(
        folder.path(),
        "DROP TABLE _sqlx_migrations; DROP TRIGGER job_metadata_status; DROP TABLE job_metadata;
         DROP TABLE metric_chunks; DROP TABLE readiness;
         DROP INDEX jobs_by_id; DROP INDEX records_by_model; DROP INDEX records_by_bytes;
         DROP INDEX artifact_names_by_hash;
         ALTER TABLE records DROP COLUMN model; ALTER TABLE records DROP COLUMN bytes;
         INSERT INTO records (id, kind, record)
         VALUES ('evl_1', 'evaluation', '{\"model_id\": \"default\", \"reports\": []}'),
             ('evl_2', 'evaluation', 'not JSON');",
    )
    .await;
    execute(folder.path(), VERSION_0_1).await;
    let app = app(test_state(folder.path()).await);
    for query in ["", "?metadata[of]=x", "?status=queued&kind=dataset.generate&metadata[of]=x"] {
        let jobs = json_of(send(&app, "GET", &format!("/jobs{query}"), "").await).await;
        assert_eq!(jobs["data"][0]["id"], json!(id), "{query}");
    }
    create_job(&app, "y").await;
    let jobs = json_of(send(&app, "GET", "/jobs?metadata[of]=y", "").await).await;
    assert_eq!(jobs["data"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn newer_and_incomplete_databases_are_rejected_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    drop(test_state(folder.path()).await);
    execute(
        folder.path(),
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
         VALUES (99, 'later', 1, x'00', 0)",
    )
    .await;
    let error = start_error(folder.path()).await;
    assert!(
        error.contains("newer version of ngf (schema 99") && error.contains("--data-dir"),
        "{error}"
    );

    let folder = tempfile::tempdir().unwrap();
    drop(test_state(folder.path()).await);
    execute(folder.path(), "ALTER TABLE jobs DROP COLUMN lease_until").await;
    let error = start_error(folder.path()).await;
    assert!(error.contains("lacks jobs.lease_until") && error.contains("backup"), "{error}");
}

#[tokio::test]
async fn unreadable_job_affects_only_itself_and_can_be_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let (damaged, intact) = {
        let app = app(test_state(folder.path()).await);
        (create_job(&app, "damaged").await, create_job(&app, "intact").await)
    };
    std::fs::create_dir_all(folder.path().join("data/work").join(&damaged)).unwrap();
    execute(
        folder.path(),
        "UPDATE jobs SET record = replace(record, '\"preset\":', '\"preset_\":')
         WHERE id = (SELECT min(id) FROM jobs);
         INSERT INTO records (id, kind, record) VALUES ('msh_1', 'mesh', 'not JSON');
         UPDATE events SET data = 'not JSON' WHERE seq = 2;",
    )
    .await;
    let app = app(test_state(folder.path()).await);
    let jobs = json_of(send(&app, "GET", "/jobs", "").await).await;
    let ids: Vec<&Value> = jobs["data"].as_array().unwrap().iter().map(|job| &job["id"]).collect();
    assert_eq!(ids, [&json!(intact)]);
    assert_eq!(json_of(send(&app, "GET", "/meshes", "").await).await["data"], json!([]));
    let events = json_of(send(&app, "GET", &format!("/jobs/{intact}/events"), "").await).await;
    assert_eq!((&events["data"][0]["seq"], &events["data"][0]["data"]), (&json!(2), &Value::Null));
    let path = format!("/jobs/{damaged}");
    let problem = assert_problem(send(&app, "GET", &path, "").await, 409, "record_damaged").await;
    assert!(problem["detail"].as_str().unwrap().contains("preset_"), "{problem}");
    create_job(&app, "another").await;
    assert!(folder.path().join("data/work").join(&damaged).exists());
    assert_eq!(send(&app, "DELETE", &path, "").await.status(), StatusCode::NO_CONTENT);
    assert_problem(send(&app, "GET", &path, "").await, 404, "job_not_found").await;
}

#[tokio::test]
async fn damaged_job_is_scheduled_again_once_its_record_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let id = create_job(&app(test_state(folder.path()).await), "x").await;
    let rename = "UPDATE jobs SET record = replace(record, '\"preset\":', '\"preset_\":')";
    execute(folder.path(), rename).await;
    drop(test_state(folder.path()).await);
    let rename = "UPDATE jobs SET record = replace(record, '\"preset_\":', '\"preset\":')";
    execute(folder.path(), rename).await;
    let app = app(test_state(folder.path()).await);
    let jobs = json_of(send(&app, "GET", "/jobs?status=queued", "").await).await;
    assert_eq!(jobs["data"][0]["id"], json!(id));
}
