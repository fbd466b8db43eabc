//! Jobs from outside: a server, the processes that it starts, and their violent ends.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

mod described;
mod proofs;
mod server;

use serde_json::{Value, json};
use server::{Server, is_alive, kill, made};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// Twenty attempts of the planner take some seconds.
fn attempts() -> Value {
    json!({ "model_id": "planner", "object": "sugar_box", "attempts": 20 })
}

/// From nothing to a policy, by the script in the documentation; gives the policy's folder.
fn from_nothing(server: &Server, folder: &Path) -> PathBuf {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/loop.sh");
    let out = folder.join("model");
    let run = Command::new(script).arg(&server.url).arg(&out).output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(run.status.success(), "{said}\n{}", String::from_utf8_lossy(&run.stderr));
    assert!(said.contains("of   2 lifted"), "{said}");
    out
}

#[test]
fn from_nothing_to_a_policy_with_curl_alone() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let out = from_nothing(&server, folder.path());
    let mut evaluate = Command::new(env!("CARGO_BIN_EXE_ngf"));
    evaluate.args(["evaluate", "--object", "sugar_box", "--attempts", "1", "--model"]).arg(&out);
    let evaluated = evaluate.output().unwrap();
    assert!(evaluated.status.success(), "{}", String::from_utf8_lossy(&evaluated.stderr));
    described::assert_all_is_described(&server);
    assert_all_can_be_deleted(&server, &folder.path().join("data"));
}

/// Jobs, models and dataset, until nothing is on the disk.
fn assert_all_can_be_deleted(server: &Server, data: &Path) {
    let ids = |path: &str| -> Vec<String> {
        let list = server.get(path);
        let all = list["data"].as_array().unwrap().iter();
        all.map(|one| one["id"].as_str().unwrap().to_owned()).collect()
    };
    let dataset = &ids("/datasets")[0];
    let training = server.ask("encoder.train", json!({ "dataset_id": dataset }));
    assert_eq!(server.delete(&format!("/datasets/{dataset}")), 409, "a job works on it");
    server.post(&format!("/jobs/{training}/cancel"), &json!({}));
    server.wait_for(&training, "cancelled");
    assert_eq!(server.delete(&format!("/datasets/{dataset}")), 204);
    assert_eq!(server.delete(&format!("/datasets/{dataset}")), 404);
    assert_eq!(server.delete("/models/default"), 409, "it is the server's");
    // In whichever order: a policy's job before its models, the encoder's after it.
    let is_of_policy = |job: &String| server.get(&format!("/jobs/{job}"))["kind"] == "policy.train";
    let (before, after): (Vec<_>, Vec<_>) = ids("/jobs").into_iter().partition(is_of_policy);
    assert!(!before.is_empty() && !after.is_empty());
    let forget = |job: &String| {
        assert_eq!(server.delete(&format!("/jobs/{job}?artifacts=true")), 204);
    };
    before.iter().for_each(forget);
    for model in ids("/models").iter().filter(|id| id.starts_with("mdl_")) {
        assert_eq!(server.delete(&format!("/models/{model}")), 204);
        assert_eq!(server.delete(&format!("/models/{model}")), 404);
    }
    after.iter().for_each(forget);
    let files = |folder: &str| -> usize {
        let entries = std::fs::read_dir(data.join(folder)).unwrap();
        let inner = |path: PathBuf| std::fs::read_dir(path).unwrap().count();
        entries.map(|entry| inner(entry.unwrap().path())).sum()
    };
    assert_eq!([files("artifacts"), files("datasets"), files("work")], [0; 3]);
}

#[test]
fn a_killed_process_and_a_killed_server_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let mut server = Server::start(&data);
    let whole = server.ask("policy.evaluate", attempts());
    server.wait_for(&whole, "succeeded");

    // The process alone.
    let id = server.ask("policy.evaluate", attempts());
    server.wait_for_progress(&id);
    let pid = server.get(&format!("/jobs/{id}"))["worker"]["pid"].as_u64().unwrap();
    kill(pid);
    let job = server.wait_for(&id, "succeeded");
    assert_eq!(job["attempt"], 2, "{job}");
    assert_eq!(made(&server, &id), made(&server, &whole));

    // The server alone: its process goes on, and reports to the next one.
    let id = server.ask("policy.evaluate", attempts());
    server.wait_for_progress(&id);
    server = server.killed_and_started(&data);
    let job = server.wait_for(&id, "succeeded");
    assert_eq!(job["attempt"], 1, "{job}");
    assert_eq!(made(&server, &id), made(&server, &whole));

    // Both.
    let id = server.ask("policy.evaluate", attempts());
    server.wait_for_progress(&id);
    let pid = server.get(&format!("/jobs/{id}"))["worker"]["pid"].as_u64().unwrap();
    kill(pid);
    server = server.killed_and_started(&data);
    server.wait_for(&id, "succeeded");
    assert_eq!(made(&server, &id), made(&server, &whole));
    let ended = |event: &Value| event["type"] == "status" && event["data"]["status"] == "succeeded";
    assert_eq!(server.events(&id).iter().filter(|event| ended(event)).count(), 1);
}

#[test]
fn a_job_stops_within_a_second_and_goes_on_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let id = server.ask("dataset.generate", json!({ "preset": "smoke" }));
    server.wait_for_progress(&id);
    let pid = server.get(&format!("/jobs/{id}"))["worker"]["pid"].as_u64().unwrap();
    let began = Instant::now();
    server.post(&format!("/jobs/{id}/pause"), &json!({}));
    server.wait_for(&id, "paused");
    assert!(began.elapsed() < Duration::from_secs(1), "{:?}", began.elapsed());
    assert!(!is_alive(pid));
    server.post(&format!("/jobs/{id}/resume"), &json!({}));
    server.wait(&id, |job| job["status"] == "running" && job["worker"]["pid"] != pid);
    let began = Instant::now();
    server.post(&format!("/jobs/{id}/cancel"), &json!({}));
    server.wait_for(&id, "cancelled");
    assert!(began.elapsed() < Duration::from_secs(1), "{:?}", began.elapsed());
    server.post(&format!("/jobs/{id}/retry"), &json!({}));
    let job = server.wait_for(&id, "succeeded");
    // As a dataset that was made in one go.
    let again = server.ask("dataset.generate", json!({ "preset": "smoke", "threads": 1 }));
    let again = server.wait_for(&again, "succeeded");
    assert_eq!(job["outputs"]["dataset_id"], again["outputs"]["dataset_id"]);
}

#[test]
fn a_stream_that_breaks_off_twenty_times_misses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let id = server.ask("policy.evaluate", attempts());
    let mut seen: Vec<Value> = Vec::new();
    let mut is_over = false;
    for connection in 0.. {
        assert!(connection < 2000);
        let last = seen.last().map_or(0, |event| event["seq"].as_i64().unwrap());
        let url = format!("{}/api/v1/jobs/{id}/stream", server.url);
        let answer = ureq::get(url).header("Last-Event-ID", last.to_string()).call().unwrap();
        if answer.status() == 204 {
            break;
        }
        // The first connections break off after one event each.
        let most = if connection < 20 { 1 } else { usize::MAX };
        let mut read = 0;
        for line in BufReader::new(answer.into_body().into_reader()).lines() {
            let line = line.unwrap();
            if line == "event: done" {
                is_over = true;
            }
            if let Some(data) = line.strip_prefix("data: ").filter(|_| !is_over) {
                seen.push(serde_json::from_str(data).unwrap());
                read += 1;
            }
            if read == most {
                break;
            }
        }
    }
    server.wait_for(&id, "succeeded");
    assert_eq!(seen, server.events(&id));
    assert!(seen.len() > 5, "{seen:?}");
}

#[test]
fn a_server_that_is_told_to_end_does_so_with_streams_open() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let mut server = Server::start(&data);
    let id = server.ask("policy.evaluate", attempts());
    server.wait_for_progress(&id);
    let read = |server: &Server, after: i64| {
        let url = format!("{}/api/v1/jobs/{id}/stream", server.url);
        let answer = ureq::get(url).header("Last-Event-ID", after.to_string()).call().unwrap();
        BufReader::new(answer.into_body().into_reader()).lines()
    };
    let events = |line: String| -> Option<Value> {
        let event: Value = serde_json::from_str(line.strip_prefix("data: ")?).ok()?;
        event["seq"].is_i64().then_some(event)
    };
    let lines = read(&server, 0);
    let began = Instant::now();
    server.terminate();
    // The stream ends with the server: cut off, as far as this reader can tell.
    let mut seen: Vec<Value> = lines.map_while(Result::ok).filter_map(events).collect();
    assert!(server.ended().success());
    assert!(began.elapsed() < Duration::from_secs(5), "{:?}", began.elapsed());
    let last = seen.last().map_or(0, |event| event["seq"].as_i64().unwrap());

    // Nothing is missed and nothing comes twice from the server after it.
    let server = Server::start(&data);
    seen.extend(read(&server, last).map_while(Result::ok).filter_map(events));
    server.wait_for(&id, "succeeded");
    assert_eq!(seen, server.events(&id));
}

#[test]
fn a_job_that_another_server_began_stops_as_soon() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let server = Server::start(&data);
    let params = json!({ "model_id": "planner", "object": "sugar_box", "attempts": 5000 });
    let id = server.ask("policy.evaluate", params);
    server.wait_for_progress(&id);
    let server = server.killed_and_started(&data);
    let pid = server.get(&format!("/jobs/{id}"))["worker"]["pid"].as_u64().unwrap();
    let done = |job: &Value| job["progress"]["completed"].as_f64().unwrap_or_default();
    let before = done(&server.get(&format!("/jobs/{id}")));
    // Its process has found the new server.
    server.wait(&id, |job| done(job) > before);
    let began = Instant::now();
    server.post(&format!("/jobs/{id}/cancel"), &json!({}));
    server.wait_for(&id, "cancelled");
    assert!(began.elapsed() < Duration::from_secs(2), "{:?}", began.elapsed());
    while is_alive(pid) {
        assert!(began.elapsed() < Duration::from_secs(5), "its process lives on");
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_mesh_is_split_into_its_convex_parts() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let mesh = server.upload(&proofs::tetrahedron(0.1));
    let id = server.ask("mesh.prepare", json!({ "mesh_id": mesh }));
    let job = server.wait_for(&id, "succeeded");
    assert_eq!(job["params"], json!({ "mesh_id": mesh }));
    let names: Vec<String> = made(&server, &id).into_iter().map(|(name, _)| name).collect();
    assert!(names.contains(&"parts.obj".to_owned()), "{names:?}");
}

#[test]
fn what_jobs_made_can_be_looked_into() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    // Whoever listens to all jobs hears of those that come.
    let all = ureq::get(format!("{}/api/v1/stream", server.url)).call().unwrap();
    let mut all = BufReader::new(all.into_body().into_reader()).lines();
    let made = server.ask("dataset.generate", json!({ "preset": "smoke" }));
    let params = json!({ "model_id": "default", "object": "sugar_box", "attempts": 1, "seed": 3 });
    let evaluated = server.ask("policy.evaluate", params);
    let job = server.wait_for(&made, "succeeded");
    let id = job["outputs"]["dataset_id"].as_str().unwrap();
    let ended = |line: String| {
        let event: Value = serde_json::from_str(line.strip_prefix("data: ")?).ok()?;
        (event["job"] == made && event["data"]["status"] == "succeeded").then_some(())
    };
    all.find_map(|line| ended(line.unwrap())).unwrap();

    let record = server.get(&format!("/datasets/{id}"));
    let kept = record["summary"]["sugar_box"]["fates"]["kept"].as_u64().unwrap();
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
    assert_eq!((&episode["pose"], &episode["name"]), (&last["pose"], &last["object"]));
    assert!(
        episode["states"].as_array().unwrap().iter().all(|row| row.as_array().unwrap().len() == 46)
    );

    let job = server.wait_for(&evaluated, "succeeded");
    let known = server.get("/models/default")["evaluations"][0].clone();
    assert_eq!((&known["job"], &known["model_id"]), (&job["id"], &json!("default")));
    let report = &known["reports"][0];
    assert_eq!((&report["attempts"], &report["seed"]), (&json!(1), &json!(3)));
    assert!(report.get("rows").is_none());
}

#[test]
fn a_second_server_on_the_same_folder_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let _server = Server::start(&data);
    let second = Command::new(env!("CARGO_BIN_EXE_ngf"))
        .args(["serve", "--port", "0", "--data"])
        .arg(&data)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(!second.status.success() && said.contains("in use by another server"), "{said}");
}

#[test]
fn an_address_that_others_reach_needs_a_token() {
    let folder = tempfile::tempdir().unwrap();
    let serve = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ngf"));
        command.args(["serve", "--port", "0", "--bind", "0.0.0.0"]).args(words);
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
fn no_token_is_written_down() {
    let folder = tempfile::tempdir().unwrap();
    let (data, log) = (folder.path().join("data"), folder.path().join("log"));
    let token = "0123456789abcdef-the-operator's";
    let token_file = folder.path().join("token");
    std::fs::write(&token_file, token).unwrap();
    let mut serve = Command::new(env!("CARGO_BIN_EXE_ngf"));
    serve.args(["serve", "--port", "0", "--log", "json", "--data"]).arg(&data);
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
    let told: Value =
        serde_json::from_slice(&std::fs::read(work.join("job.json")).unwrap()).unwrap();
    let text = std::fs::read_to_string(&log).unwrap();
    let said = std::fs::read_to_string(work.join("log.txt")).unwrap();
    let events = json!(server.events(id)).to_string();
    for secret in [token, told["token"].as_str().unwrap()] {
        assert!(secret.len() > 16 && !text.contains(secret), "in the server's log");
        assert!(!said.contains(secret) && !events.contains(secret), "in the job's log");
    }
    let lines: Vec<Value> =
        text.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    let answered = |line: &&Value| line["message"] == "answered" && line["method"] == "POST";
    let asked = lines.iter().find(answered).unwrap();
    assert_eq!((&asked["path"], &asked["status"]), (&json!("/api/v1/jobs"), &json!(201)));
}
