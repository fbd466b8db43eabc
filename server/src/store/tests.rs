//! Full databases, and the duration of queries of large ones.

use super::{EventType, NewEvent, RecordKind, Store};
use crate::AppState;
use crate::jobs::kinds::MeshParams;
use crate::jobs::scheduler::{JobScheduler, SchedulerConfig};
use crate::jobs::{Inputs, Job, Params};
use axum::Router;
use axum::body::Body;
use axum::http::Request;
use http_body_util::BodyExt;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use tower::ServiceExt;

fn job() -> Job {
    let params = MeshParams { mesh_id: "msh_1".into(), ..MeshParams::default() };
    let mut job = Job::new(Params::MeshPrepare(params), Inputs::default());
    job.metadata = json!({ "of": "test" }).as_object().cloned().unwrap();
    job
}

#[tokio::test]
async fn store_writes_again_after_a_transaction_failed_on_a_full_disk() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    store.create(&job(), None).await.unwrap();
    let set_limit = async |pages: i64| {
        let limit = sqlx::AssertSqlSafe(format!("PRAGMA max_page_count = {pages}"));
        sqlx::query(limit).execute(&store.writer).await.unwrap();
    };
    // The statement that fails, and whether SQLite ends its transaction, depend on the number of free pages.
    for free_pages in 0..6 {
        // SQLite reports a full disk at this number of pages.
        let pages: i64 =
            sqlx::query_scalar("PRAGMA page_count").fetch_one(&store.writer).await.unwrap();
        set_limit(pages + free_pages).await;
        let failure = loop {
            if let Err(error) = store.create(&job(), None).await {
                break error;
            }
        };
        assert!(failure.is_disk_full(), "{failure}");
        set_limit(MAX_PAGES).await;
        store.create(&job(), None).await.unwrap();
        store.check_writable().await.unwrap();
    }
}

/// Default limit of SQLite.
const MAX_PAGES: i64 = 0xffff_fffe;

/// A server, its scheduler and its folder.
async fn server() -> (Router, std::sync::Arc<JobScheduler>, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let config = SchedulerConfig {
        data_dir: folder.path().to_owned(),
        models_dir: folder.path().join("models"),
        program: "ngf".into(),
        waits_for_program: false,
        max_concurrent: 0,
        min_free_bytes: 0,
    };
    let scheduler = JobScheduler::open(config).await.unwrap();
    let state = AppState::new(folder.path(), folder.path());
    let state = state.with_scheduler(scheduler.clone(), tokio::sync::watch::channel(false).1);
    (crate::app(state), scheduler, folder)
}

/// The shortest of 5 durations of a GET request, and its response. Other tests run at the same time.
async fn timed(app: &Router, path: &str) -> (Duration, Value) {
    let (mut shortest, mut durations) = (Duration::MAX, Vec::new());
    let mut bytes = Default::default();
    for _ in 0..5 {
        let start = Instant::now();
        let request = Request::get(format!("/api/v1{path}")).body(Body::empty()).unwrap();
        let response = app.clone().oneshot(request).await.unwrap();
        bytes = response.into_body().collect().await.unwrap().to_bytes();
        durations.push(start.elapsed());
        shortest = shortest.min(start.elapsed());
    }
    println!("{path}: {durations:?}");
    (shortest, serde_json::from_slice(&bytes).unwrap())
}

#[tokio::test]
async fn metrics_of_a_long_training_are_read_within_50_ms() {
    let (app, scheduler, _folder) = server().await;
    let job = job();
    scheduler.store.create(&job, None).await.unwrap();
    // 200,000 events in reports of a second of a fast training.
    for report in 0..400 {
        let append = |_: &mut Job, events: &mut Vec<NewEvent>| {
            events.extend((0..500).map(|event| {
                let step = 500 * report + event + 1;
                let loss = if step == 123_457 { 9.0 } else { 1.0 / f64::from(step) };
                let data = json!({
                    "step": step, "loss": loss, "imitation": 0.5 * loss, "fingertips": 0.1,
                    "rate": 1e-4, "gradient": f64::from(event), "steps_per_second": 480.0,
                });
                NewEvent::new(EventType::Metric, "", data)
            }));
            Ok::<_, ()>(())
        };
        scheduler.store.update(&job.id, append).await.unwrap().unwrap().unwrap();
    }
    let (duration, metrics) = timed(&app, &format!("/jobs/{}/metrics", job.id)).await;
    let steps = metrics["step"].as_array().unwrap();
    // Up to 1000; one row can be the extreme of several columns.
    assert!((300..=1000).contains(&steps.len()), "{}", steps.len());
    let peak = steps.iter().position(|step| step == 123_457).expect("the peak is kept");
    assert_eq!(metrics["loss"][peak], 9);
    assert!(duration <= Duration::from_millis(50), "{duration:?}");
    // All rows are there, in order.
    let path =
        format!("/jobs/{}/metrics?keys=gradient&max_points=100000&after_step=150000", job.id);
    let (_, all) = timed(&app, &path).await;
    assert_eq!(all["step"].as_array().unwrap().len(), 50_000);
    assert_eq!((&all["step"][0], &all["gradient"][0]), (&json!(150_001), &json!(0)));
    scheduler.store.delete_job(&job.id).await.unwrap();
    let chunks: i64 = sqlx::query_scalar("SELECT count(*) FROM metric_chunks")
        .fetch_one(&scheduler.store.readers)
        .await
        .unwrap();
    assert_eq!(chunks, 0);
}

#[tokio::test]
async fn filtered_lists_of_10000_jobs_are_read_within_10_ms() {
    let (app, scheduler, _folder) = server().await;
    let job = job();
    scheduler.store.create(&job, None).await.unwrap();
    // Copies of the job; every thousandth one has failed, with rare metadata.
    sqlx::raw_sql(
        "WITH RECURSIVE numbers (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM numbers WHERE n < 10000)
         INSERT INTO jobs (id, kind, status, priority, lease_until, record)
         SELECT printf('job_0%031d', n), kind, iif(n % 1000 = 0, 'failed', 'succeeded'), 0, 0,
             json_set(record, '$.id', printf('job_0%031d', n), '$.name', printf('%.*c', 200, 'x'),
                 '$.status', iif(n % 1000 = 0, 'failed', 'succeeded'))
         FROM jobs, numbers;
         INSERT INTO job_metadata
         SELECT 'of', iif(status = 'failed', 'rare', 'frequent'), id, kind, status FROM jobs
         WHERE id LIKE 'job_0000%';",
    )
    .execute(&scheduler.store.writer)
    .await
    .unwrap();
    for (query, count) in [
        ("", 20),
        ("?limit=100", 100),
        ("?status=failed", 10),
        ("?status=succeeded", 20),
        ("?status=failed,cancelled&kind=mesh.prepare&limit=100", 10),
        ("?kind=dataset.generate", 0),
        ("?metadata[of]=rare", 10),
        ("?metadata[of]=frequent&order=asc", 20),
        ("?metadata[of]=frequent&status=failed", 0),
        ("?metadata[of]=frequent&kind=dataset.generate", 0),
        ("?metadata[of]=absent", 0),
    ] {
        let (duration, jobs) = timed(&app, &format!("/jobs{query}")).await;
        assert_eq!(jobs["data"].as_array().unwrap().len(), count, "{query}");
        assert!(duration <= Duration::from_millis(10), "{query}: {duration:?}");
    }
}

#[tokio::test]
async fn sizes_of_10000_meshes_are_added_up_within_10_ms() {
    let (_, scheduler, _folder) = server().await;
    // Records have about a kilobyte. One is damaged.
    sqlx::raw_sql(
        "WITH RECURSIVE numbers (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM numbers WHERE n < 10000)
         INSERT INTO records (id, kind, record)
         SELECT printf('msh_%016d', n), 'mesh',
             json_object('bytes', n, 'summary', printf('%.*c', 1000, 'x')) FROM numbers;
         INSERT INTO records (id, kind, record) VALUES ('msh_damaged', 'mesh', '{\"bytes\":');",
    )
    .execute(&scheduler.store.writer)
    .await
    .unwrap();
    let mut shortest = Duration::MAX;
    for _ in 0..5 {
        let start = Instant::now();
        assert_eq!(scheduler.store.total_bytes(RecordKind::Mesh).await.unwrap(), 50_005_000);
        shortest = shortest.min(start.elapsed());
    }
    println!("{shortest:?}");
    assert!(shortest <= Duration::from_millis(10), "{shortest:?}");
}
