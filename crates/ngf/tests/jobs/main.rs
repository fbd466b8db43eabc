//! End-to-end tests of jobs: a server, its workers, and kills of both. `cargo test -p ngf -p ngf-worker` also
//! builds the worker executable that they need.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

mod api_docs;
#[cfg(unix)]
mod connections;
mod datasets;
#[cfg(unix)]
mod full_disk;
mod openapi_conformance;
#[cfg(unix)]
mod permissions;
mod server;
mod stress;

use serde_json::{Value, json};
use server::{Server, is_alive, job_outputs, kill};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// Parameters of an evaluation that takes some seconds.
fn evaluation_params() -> Value {
    json!({ "model_id": "planner", "object": "sugar_box", "attempts": 20 })
}

/// Runs the whole pipeline with the script of the documentation; returns the folder of the policy.
fn run_pipeline(server: &Server, folder: &Path) -> PathBuf {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/end_to_end.sh");
    let out = folder.join("model");
    let run = Command::new(script).arg(&server.url).arg(&out).output().unwrap();
    let output = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(run.status.success(), "{output}\n{}", String::from_utf8_lossy(&run.stderr));
    assert!(output.contains("of   2 lifted"), "{output}");
    out
}

#[test]
fn pipeline_runs_with_curl() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let out = run_pipeline(&server, folder.path());
    let mut evaluate = Command::new(env!("CARGO_BIN_EXE_ngf"));
    evaluate.args(["evaluate", "--object", "sugar_box", "--attempts", "1", "--model"]).arg(&out);
    let evaluated = evaluate.output().unwrap();
    assert!(evaluated.status.success(), "{}", String::from_utf8_lossy(&evaluated.stderr));
    openapi_conformance::assert_all_endpoints_match_schema(&server);
    assert_all_can_be_deleted(&server, &folder.path().join("data"));
}

/// Deletes all jobs, models and datasets, and checks that no files remain.
fn assert_all_can_be_deleted(server: &Server, data: &Path) {
    let ids = |path: &str| -> Vec<String> {
        let list = server.get(path);
        let all = list["data"].as_array().unwrap().iter();
        all.map(|record| record["id"].as_str().unwrap().to_owned()).collect()
    };
    let datasets = ids("/datasets");
    let [dataset, others @ ..] = &datasets[..] else { panic!("no dataset") };
    let training = server.create_job("encoder.train", json!({ "dataset_id": dataset }));
    assert_eq!(server.delete(&format!("/datasets/{dataset}")), 409, "a job uses it");
    server.post(&format!("/jobs/{training}/cancel"), &json!({}));
    server.wait_for(&training, "cancelled");
    assert_eq!(server.delete(&format!("/datasets/{dataset}")), 204);
    assert_eq!(server.delete(&format!("/datasets/{dataset}")), 404);
    for other in others {
        assert_eq!(server.delete(&format!("/datasets/{other}")), 204);
    }
    assert_eq!(server.delete("/models/default"), 409, "bundled models are read-only");
    // Jobs and models can be deleted in any order: the policy job before its models, the encoder job after
    // its model.
    let is_of_policy = |job: &String| server.get(&format!("/jobs/{job}"))["kind"] == "policy.train";
    let (before, after): (Vec<_>, Vec<_>) = ids("/jobs").into_iter().partition(is_of_policy);
    assert!(!before.is_empty() && !after.is_empty());
    let delete_job = |job: &String| {
        assert_eq!(server.delete(&format!("/jobs/{job}?artifacts=true")), 204);
    };
    before.iter().for_each(delete_job);
    for model in ids("/models").iter().filter(|id| id.starts_with("mdl_")) {
        assert_eq!(server.delete(&format!("/models/{model}")), 204);
        assert_eq!(server.delete(&format!("/models/{model}")), 404);
    }
    after.iter().for_each(delete_job);
    let files = |folder: &str| -> usize {
        let entries = std::fs::read_dir(data.join(folder)).unwrap();
        let inner = |path: PathBuf| std::fs::read_dir(path).unwrap().count();
        entries.map(|entry| inner(entry.unwrap().path())).sum()
    };
    assert_eq!([files("artifacts"), files("datasets"), files("work")], [0; 3]);
}

#[test]
fn killed_worker_or_server_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let mut server = Server::start(&data);
    let reference = server.create_job("policy.evaluate", evaluation_params());
    server.wait_for(&reference, "succeeded");

    // Kill only the worker.
    let id = server.create_job("policy.evaluate", evaluation_params());
    server.wait_for_progress(&id);
    let pid = server.get(&format!("/jobs/{id}"))["worker"]["pid"].as_u64().unwrap();
    kill(pid);
    let job = server.wait_for(&id, "succeeded");
    assert_eq!(job["attempt"], 2, "{job}");
    assert_eq!(job_outputs(&server, &id), job_outputs(&server, &reference));

    // Kill only the server. Its worker continues and reports to the next server.
    let id = server.create_job("policy.evaluate", evaluation_params());
    server.wait_for_progress(&id);
    server = server.kill_and_restart(&data);
    let job = server.wait_for(&id, "succeeded");
    assert_eq!(job["attempt"], 1, "{job}");
    assert_eq!(job_outputs(&server, &id), job_outputs(&server, &reference));

    // Kill worker and server.
    let id = server.create_job("policy.evaluate", evaluation_params());
    server.wait_for_progress(&id);
    let pid = server.get(&format!("/jobs/{id}"))["worker"]["pid"].as_u64().unwrap();
    kill(pid);
    server = server.kill_and_restart(&data);
    server.wait_for(&id, "succeeded");
    assert_eq!(job_outputs(&server, &id), job_outputs(&server, &reference));
    let is_success =
        |event: &Value| event["type"] == "status" && event["data"]["status"] == "succeeded";
    assert_eq!(server.events(&id).iter().filter(|event| is_success(event)).count(), 1);
}

#[test]
fn job_stops_within_a_second_and_resumes() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    // One thread, so that the job takes long enough to be stopped twice.
    let params = json!({ "preset": "smoke", "threads": 1, "point_clouds": true });
    let id = server.create_job("dataset.generate", params);
    server.wait_for_progress(&id);
    let pid = server.get(&format!("/jobs/{id}"))["worker"]["pid"].as_u64().unwrap();
    let start = Instant::now();
    server.post(&format!("/jobs/{id}/pause"), &json!({}));
    server.wait_for(&id, "paused");
    assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
    assert!(!is_alive(pid));
    server.post(&format!("/jobs/{id}/resume"), &json!({}));
    server.wait(&id, |job| job["status"] == "running" && job["worker"]["pid"] != pid);
    let start = Instant::now();
    server.post(&format!("/jobs/{id}/cancel"), &json!({}));
    server.wait_for(&id, "cancelled");
    assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
    server.post(&format!("/jobs/{id}/retry"), &json!({}));
    let job = server.wait_for(&id, "succeeded");
    // Equal to a dataset from an uninterrupted job.
    let params = json!({ "preset": "smoke", "point_clouds": true });
    let again = server.create_job("dataset.generate", params);
    let again = server.wait_for(&again, "succeeded");
    assert_eq!(job["outputs"]["dataset_id"], again["outputs"]["dataset_id"]);
}

#[test]
fn stream_misses_no_event_after_twenty_disconnects() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let id = server.create_job("policy.evaluate", evaluation_params());
    let mut seen: Vec<Value> = Vec::new();
    let mut is_over = false;
    for connection in 0.. {
        assert!(connection < 2000);
        let last = seen.last().map_or(0, |event| event["seq"].as_i64().unwrap());
        let url = format!("{}/api/v1/jobs/{id}/stream", server.url);
        let response = ureq::get(url).header("Last-Event-ID", last.to_string()).call().unwrap();
        if response.status() == 204 {
            break;
        }
        // The first connections disconnect after one event each.
        let max_events = if connection < 20 { 1 } else { usize::MAX };
        let mut read = 0;
        for line in BufReader::new(response.into_body().into_reader()).lines() {
            let line = line.unwrap();
            if line == "event: done" {
                is_over = true;
            }
            if let Some(data) = line.strip_prefix("data: ").filter(|_| !is_over) {
                seen.push(serde_json::from_str(data).unwrap());
                read += 1;
            }
            if read == max_events {
                break;
            }
        }
    }
    server.wait_for(&id, "succeeded");
    assert_eq!(seen, server.events(&id));
    assert!(seen.len() > 5, "{seen:?}");
}

#[test]
fn server_shuts_down_with_open_streams() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let mut server = Server::start(&data);
    let id = server.create_job("policy.evaluate", evaluation_params());
    server.wait_for_progress(&id);
    let read = |server: &Server, after: i64| {
        let url = format!("{}/api/v1/jobs/{id}/stream", server.url);
        let response = ureq::get(url).header("Last-Event-ID", after.to_string()).call().unwrap();
        BufReader::new(response.into_body().into_reader()).lines()
    };
    let events = |line: String| -> Option<Value> {
        let event: Value = serde_json::from_str(line.strip_prefix("data: ")?).ok()?;
        event["seq"].is_i64().then_some(event)
    };
    let lines = read(&server, 0);
    let start = Instant::now();
    server.terminate();
    // The stream ends with the server, without a regular end for the reader.
    let mut seen: Vec<Value> = lines.map_while(Result::ok).filter_map(events).collect();
    assert!(server.wait_for_exit().success());
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
    let last = seen.last().map_or(0, |event| event["seq"].as_i64().unwrap());

    // The next server sends every remaining event exactly once.
    let server = Server::start(&data);
    seen.extend(read(&server, last).map_while(Result::ok).filter_map(events));
    server.wait_for(&id, "succeeded");
    assert_eq!(seen, server.events(&id));
}

#[test]
fn job_of_previous_server_stops_within_seconds() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let server = Server::start(&data);
    let params = json!({ "model_id": "planner", "object": "sugar_box", "attempts": 5000 });
    let id = server.create_job("policy.evaluate", params);
    server.wait_for_progress(&id);
    let server = server.kill_and_restart(&data);
    let pid = server.get(&format!("/jobs/{id}"))["worker"]["pid"].as_u64().unwrap();
    let done = |job: &Value| job["progress"]["completed"].as_f64().unwrap_or_default();
    let before = done(&server.get(&format!("/jobs/{id}")));
    // The worker has reported to the new server.
    server.wait(&id, |job| done(job) > before);
    let start = Instant::now();
    server.post(&format!("/jobs/{id}/cancel"), &json!({}));
    server.wait_for(&id, "cancelled");
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
    while is_alive(pid) {
        assert!(start.elapsed() < Duration::from_secs(5), "the worker is still running");
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn mesh_job_writes_convex_parts() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let mesh = server.upload(&stress::tetrahedron(0.1));
    let id = server.create_job("mesh.prepare", json!({ "mesh_id": mesh }));
    let job = server.wait_for(&id, "succeeded");
    assert_eq!(job["params"]["mesh_id"], mesh);
    let names: Vec<String> = job_outputs(&server, &id).into_iter().map(|(name, _)| name).collect();
    assert!(names.contains(&"parts.obj".to_owned()), "{names:?}");
}

#[test]
fn grasp_search_job_writes_grasps() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let params = json!({ "object": "sugar_box", "effort": "quick" });
    let id = server.create_job("grasps.search", params);
    server.wait_for(&id, "succeeded");
    let outputs = job_outputs(&server, &id);
    let (_, hash) = outputs.iter().find(|(name, _)| name == "grasps.json").unwrap();
    let mut file = ureq::get(format!("{}/api/v1/artifacts/{hash}", server.url)).call().unwrap();
    let set: Value = file.body_mut().read_json().unwrap();
    assert!(!set["grasps"].as_array().unwrap().is_empty(), "{set}");
}

#[test]
fn job_outputs_can_be_inspected() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    // The stream of all jobs includes later jobs.
    let all = ureq::get(format!("{}/api/v1/stream", server.url)).call().unwrap();
    let mut all = BufReader::new(all.into_body().into_reader()).lines();
    let generated = server.create_job("dataset.generate", json!({ "preset": "smoke" }));
    let params = json!({ "model_id": "default", "object": "sugar_box", "attempts": 1, "seed": 3 });
    let evaluated = server.create_job("policy.evaluate", params);
    let job = server.wait_for(&generated, "succeeded");
    let id = job["outputs"]["dataset_id"].as_str().unwrap();
    let is_generated = |line: String| {
        let event: Value = serde_json::from_str(line.strip_prefix("data: ")?).ok()?;
        (event["job"] == generated && event["data"]["status"] == "succeeded").then_some(())
    };
    all.find_map(|line| is_generated(line.unwrap())).unwrap();

    let record = server.get(&format!("/datasets/{id}"));
    let kept = record["summary"]["sugar_box"]["outcomes"]["kept"].as_u64().unwrap();
    let mut entries: Vec<Value> = Vec::new();
    loop {
        let after =
            entries.last().map_or(String::new(), |entry| format!("&after={}", entry["index"]));
        let page = server.get(&format!("/datasets/{id}/episodes?limit=5{after}"));
        entries.extend(page["data"].as_array().unwrap().iter().cloned());
        if page["has_more"] == false {
            break;
        }
    }
    let indices: Vec<u64> = entries.iter().map(|entry| entry["index"].as_u64().unwrap()).collect();
    assert_eq!(indices, (0..kept).collect::<Vec<_>>());
    let other = server.get(&format!("/datasets/{id}/episodes?object=bleach"));
    assert_eq!(other["data"], json!([]));
    let last = entries.last().unwrap();
    let episode = server.get(&format!("/datasets/{id}/episodes/{}", kept - 1));
    assert_eq!(
        (&episode["object_pose"], &episode["object_name"]),
        (&last["pose"], &last["object"])
    );
    assert!(
        episode["states"].as_array().unwrap().iter().all(|row| row.as_array().unwrap().len() == 46)
    );
    datasets::assert_archive_restores_dataset(&server, id);
    let hash = record["hash"].as_str().unwrap();
    let dataset = folder.path().join("data/datasets").join(hash);
    datasets::assert_unreadable_episodes_are_reported(&server, id, &dataset);

    let job = server.wait_for(&evaluated, "succeeded");
    let known = server.get("/models/default")["evaluations"][0].clone();
    assert_eq!((&known["job"], &known["model_id"]), (&job["id"], &json!("default")));
    let report = &known["reports"][0];
    assert_eq!((&report["attempts"], &report["seed"]), (&json!(1), &json!(3)));
    assert!(report.get("rows").is_none());
}

#[test]
fn second_server_on_same_folder_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let _server = Server::start(&data);
    let second = Command::new(env!("CARGO_BIN_EXE_ngf"))
        .args(["serve", "--port", "0", "--data-dir"])
        .arg(&data)
        .output()
        .unwrap();
    let output = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(!second.status.success() && output.contains("in use by another server"), "{output}");
}

#[test]
fn public_address_needs_token() {
    let folder = tempfile::tempdir().unwrap();
    let serve = |options: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ngf"));
        command.args(["serve", "--port", "0", "--bind", "0.0.0.0"]).args(options);
        let output = command.output().unwrap();
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(serve(&[]).contains("--token-file"));
    let file = folder.path().join("token");
    let file_name = file.to_str().unwrap();
    assert!(serve(&["--token-file", file_name]).contains("cannot read the token"));
    std::fs::write(&file, "short").unwrap();
    assert!(serve(&["--token-file", file_name]).contains("fewer than 16"));
}

#[test]
fn logs_contain_no_tokens() {
    let folder = tempfile::tempdir().unwrap();
    let (data, log) = (folder.path().join("data"), folder.path().join("log"));
    let token = "0123456789abcdef-the-operator's";
    let token_file = folder.path().join("token");
    std::fs::write(&token_file, token).unwrap();
    let mut serve = Command::new(env!("CARGO_BIN_EXE_ngf"));
    serve.args(["serve", "--port", "0", "--log", "json", "--data-dir"]).arg(&data);
    serve.arg("--token-file").arg(&token_file).env("NGF_LOG", "trace");
    let server = Server::spawn(serve.stderr(std::fs::File::create(&log).unwrap()));
    let evaluation =
        json!({ "model_id": "planner", "object": "sugar_box", "attempts": 1, "seed": 1 });
    let job = ureq::post(format!("{}/api/v1/jobs", server.url))
        .header("Authorization", format!("Bearer {token}"))
        .send_json(json!({ "kind": "policy.evaluate", "params": evaluation }));
    let job: Value = job.unwrap().body_mut().read_json().unwrap();
    let id = job["id"].as_str().unwrap();
    server.wait_for(id, "succeeded");
    let work = data.join("work").join(id);
    let worker_config: Value =
        serde_json::from_slice(&std::fs::read(work.join("worker.json")).unwrap()).unwrap();
    let text = std::fs::read_to_string(&log).unwrap();
    let output = std::fs::read_to_string(work.join("log.txt")).unwrap();
    let events = json!(server.events(id)).to_string();
    for secret in [token, worker_config["token"].as_str().unwrap()] {
        assert!(secret.len() > 16 && !text.contains(secret), "token in the server log");
        assert!(!output.contains(secret) && !events.contains(secret), "token in the job log");
    }
    let lines: Vec<Value> =
        text.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    let is_post_response =
        |line: &&Value| line["message"] == "response" && line["method"] == "POST";
    let logged = lines.iter().find(is_post_response).unwrap();
    assert_eq!((&logged["path"], &logged["status"]), (&json!("/api/v1/jobs"), &json!(201)));
}
