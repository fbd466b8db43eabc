//! A server process for tests, and its HTTP client.

use crate::openapi_conformance::assert_matches_schema;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// A server on a free port, killed on drop.
pub(crate) struct Server {
    process: Child,
    pub(crate) url: String,
}

impl Server {
    pub(crate) fn start(data: &Path) -> Self {
        Self::start_at("0", data)
    }

    /// Kills the server and starts another one at the same address.
    pub(crate) fn kill_and_restart(self, data: &Path) -> Self {
        let port = self.url.rsplit(':').next().unwrap().to_owned();
        drop(self);
        Self::start_at(&port, data)
    }

    pub(crate) fn start_at(port: &str, data: &Path) -> Self {
        let mut serve = Command::new(env!("CARGO_BIN_EXE_ngf"));
        let models = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models");
        serve.args(["serve", "--port", port, "--models-dir", models, "--data-dir"]);
        Self::spawn(serve.arg(data))
    }

    pub(crate) fn spawn(serve: &mut Command) -> Self {
        let mut process = serve.stdout(Stdio::piped()).spawn().unwrap();
        let mut url = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut url).unwrap();
        assert!(url.starts_with("http://"), "{url}");
        Self { process, url: url.trim().to_owned() }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.process.id()
    }

    pub(crate) fn get(&self, path: &str) -> Value {
        self.get_path(&format!("/api/v1{path}"))
    }

    /// GET of a server path, validated against the OpenAPI description.
    pub(crate) fn get_path(&self, path: &str) -> Value {
        let url = format!("{}{path}", self.url);
        let response = ureq::get(url).call().unwrap_or_else(|error| panic!("{path}: {error}"));
        let body = response.into_body().read_json().unwrap();
        assert_matches_schema("get", path, &body);
        body
    }

    /// GET that is answered with this error status; returns the problem.
    pub(crate) fn get_problem(&self, path: &str, status: u16) -> Value {
        let agent = ureq::Agent::config_builder().http_status_as_error(false).build().new_agent();
        let mut response = agent.get(format!("{}/api/v1{path}", self.url)).call().unwrap();
        assert_eq!(response.status().as_u16(), status, "{path}");
        response.body_mut().read_json().unwrap()
    }

    pub(crate) fn post(&self, path: &str, request: &Value) -> Value {
        let path = format!("/api/v1{path}");
        let response = ureq::post(format!("{}{path}", self.url)).send_json(request);
        let body = response.unwrap().body_mut().read_json().unwrap();
        assert_matches_schema("post", &path, &body);
        body
    }

    /// Sends DELETE; returns the status code.
    pub(crate) fn delete(&self, path: &str) -> u16 {
        let agent = ureq::Agent::config_builder().http_status_as_error(false).build().new_agent();
        agent.delete(format!("{}/api/v1{path}", self.url)).call().unwrap().status().as_u16()
    }

    /// Sends SIGTERM.
    pub(crate) fn terminate(&self) {
        let signalled = Command::new("kill").arg(self.pid().to_string()).status();
        assert!(signalled.unwrap().success());
    }

    /// Waits for the exit of the process.
    pub(crate) fn wait_for_exit(&mut self) -> ExitStatus {
        self.process.wait().unwrap()
    }

    /// Uploads a mesh; returns its id.
    pub(crate) fn upload(&self, obj: &str) -> Value {
        let url = format!("{}/api/v1/meshes?name=mesh.obj", self.url);
        let mesh: Value = ureq::post(url).send(obj).unwrap().body_mut().read_json().unwrap();
        assert_matches_schema("post", "/api/v1/meshes", &mesh);
        mesh["id"].clone()
    }

    /// Creates a job; returns its id.
    pub(crate) fn create_job(&self, kind: &str, params: Value) -> String {
        let job = self.post("/jobs", &json!({ "kind": kind, "params": params }));
        assert_eq!(job["status"], "queued", "{job}");
        job["id"].as_str().unwrap().to_owned()
    }

    /// Polls the job until the condition holds.
    pub(crate) fn wait(&self, id: &str, condition: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let job = self.get(&format!("/jobs/{id}"));
            if condition(&job) {
                return job;
            }
            assert!(start.elapsed() < Duration::from_secs(240), "{job}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    pub(crate) fn wait_for(&self, id: &str, status: &str) -> Value {
        self.wait(id, |job| {
            assert!(job["status"] != "failed" || status == "failed", "{job}");
            job["status"] == status
        })
    }

    /// Waits until the job reports progress.
    pub(crate) fn wait_for_progress(&self, id: &str) {
        self.wait(id, |job| job["progress"]["completed"].as_f64().is_some_and(|done| done > 0.0));
    }

    pub(crate) fn events(&self, id: &str) -> Vec<Value> {
        let mut all = Vec::new();
        loop {
            let after = all.last().map_or(0, |event: &Value| event["seq"].as_i64().unwrap());
            let page = self.get(&format!("/jobs/{id}/events?after={after}&limit=100"));
            all.extend(page["data"].as_array().unwrap().iter().cloned());
            if page["has_more"] == false {
                return all;
            }
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

/// Sends SIGKILL, as the kernel does when memory is exhausted.
pub(crate) fn kill(pid: u64) {
    assert!(Command::new("kill").args(["-9", &pid.to_string()]).status().unwrap().success());
}

/// Whether a process is running.
pub(crate) fn is_alive(pid: u64) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    stat.split(' ').nth(2).is_some_and(|state| state != "Z")
}

/// Ids and hashes of the outputs of a job, except for logs, which contain times.
pub(crate) fn job_outputs(server: &Server, id: &str) -> Vec<(String, String)> {
    let outputs = server.get(&format!("/jobs/{id}"))["outputs"].clone();
    let ids = ["dataset_id", "model_id"].map(|name| (name.to_owned(), outputs[name].to_string()));
    let artifacts = server.get(&format!("/jobs/{id}/artifacts"));
    let text = |artifact: &Value, name: &str| artifact[name].as_str().unwrap().to_owned();
    let all = artifacts["data"].as_array().unwrap().iter();
    all.map(|artifact| (text(artifact, "name"), text(artifact, "hash")))
        .filter(|(name, _)| !name.ends_with(".txt") && !name.ends_with(".jsonl"))
        .chain(ids)
        .collect()
}
