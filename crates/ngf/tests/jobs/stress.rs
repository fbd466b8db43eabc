//! Stress tests that take minutes: twenty kills, 100 concurrent readers, 10,000 uploads, stalled bodies.
//! `cargo xtask stress` runs them.

use crate::server::{Server, is_alive, job_outputs, kill};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// All job kinds with parameters that take seconds.
fn tasks(server: &Server) -> Vec<(&'static str, Value)> {
    let dataset = json!({ "preset": "smoke" });
    let generated = server.create_job("dataset.generate", dataset.clone());
    let dataset_id = server.wait_for(&generated, "succeeded")["outputs"]["dataset_id"].clone();
    let encoder = json!({ "dataset_id": dataset_id, "steps": 60, "checkpoint_every": 10 });
    let trained = server.create_job("encoder.train", encoder.clone());
    let encoder_id = server.wait_for(&trained, "succeeded")["outputs"]["model_id"].clone();
    let policy = json!({
        "dataset_id": dataset_id, "encoder_id": encoder_id,
        "steps": 400, "batch": 32, "checkpoint_every": 50,
    });
    let evaluation = json!({ "model_id": "planner", "object": "sugar_box", "attempts": 30 });
    vec![
        ("dataset.generate", dataset),
        ("encoder.train", encoder),
        ("policy.train", policy),
        ("policy.evaluate", evaluation),
        ("grasps.search", json!({ "object": "sugar_box", "effort": "quick" })),
        ("mesh.prepare", json!({ "mesh_id": server.upload(&tetrahedron(0.1)) })),
    ]
}

/// Deterministic random generator for kill times.
struct KillTimes(u64);

impl KillTimes {
    /// Next number in [0, 1].
    fn next(&mut self) -> f64 {
        // Steele and Vigna's splitmix64.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    }
}

#[test]
#[ignore = "minutes: cargo xtask stress"]
fn twenty_kills_change_no_outputs() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let mut server = Server::start(&data);
    let tasks = tasks(&server);
    let mut references = Vec::new();
    for (kind, params) in &tasks {
        let start = Instant::now();
        let id = server.create_job(kind, params.clone());
        server.wait_for(&id, "succeeded");
        references.push((job_outputs(&server, &id), start.elapsed().as_secs_f64()));
    }
    let (mut kill_times, mut pids) = (KillTimes(1), Vec::new());
    for round in 0..20 {
        let (kind, params) = &tasks[round % tasks.len()];
        let (expected, seconds) = &references[round % tasks.len()];
        let id = server.create_job(kind, params.clone());
        let job = server.wait(&id, |job| job["worker"]["pid"].is_u64());
        let pid = job["worker"]["pid"].as_u64().unwrap();
        let pause = kill_times.next() * seconds;
        std::thread::sleep(Duration::from_secs_f64(pause));
        // Shifted in each cycle, so that every kind meets every victim for any number of kinds.
        let (cycle, task) = (round / tasks.len(), round % tasks.len());
        let victim = ["worker", "server", "both"][(cycle + task) % 3];
        // The worker may have exited already.
        if victim != "server" && is_alive(pid) {
            kill(pid);
        }
        if victim != "worker" {
            server = server.kill_and_restart(&data);
        }
        let job = server.wait_for(&id, "succeeded");
        println!("{kind}: {victim} after {pause:.1} s; attempt {}", job["attempt"]);
        assert_eq!(&job_outputs(&server, &id), expected, "{kind}: {victim} after {pause} s");
        let is_end = |event: &&Value| event["data"]["status"] == "succeeded";
        assert_eq!(server.events(&id).iter().filter(is_end).count(), 1, "{kind}");
        pids.extend([pid, job["worker"]["pid"].as_u64().unwrap()]);
    }
    let jobs = server.get("/jobs?limit=100");
    let is_done = |job: &Value| job["status"] == "succeeded";
    assert!(jobs["data"].as_array().unwrap().iter().all(is_done), "{jobs}");
    assert!(!pids.into_iter().any(is_alive), "a worker is still running");
}

#[test]
#[ignore = "a minute: cargo xtask stress"]
fn smoke_pipeline_takes_less_than_a_minute() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let start = Instant::now();
    crate::run_pipeline(&server, folder.path());
    let seconds = start.elapsed().as_secs_f64();
    println!("smoke pipeline up to an evaluated policy: {seconds:.0} s");
    assert!(seconds < 60.0, "{seconds}");
}

/// Resident memory of a process (bytes).
pub(crate) fn resident(pid: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    1024 * line.trim().trim_end_matches(" kB").parse::<u64>().unwrap()
}

/// Number of concurrent readers, and the pause of each reader between requests.
const READERS: usize = 80;
/// Number of concurrent subscribers of the event stream.
const SUBSCRIBERS: usize = 20;
const PAUSE: Duration = Duration::from_millis(100);

#[test]
#[ignore = "ten minutes: cargo xtask stress"]
fn server_answers_concurrent_readers_while_a_job_trains() {
    let seconds = std::env::var("NGF_SECONDS").map_or(600, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let mut serve = Command::new(env!("CARGO_BIN_EXE_ngf"));
    serve.args(["serve", "--port", "0", "--data-dir"]).arg(folder.path().join("data"));
    let server = Server::spawn(serve.arg("--models-dir").arg(models).env("NGF_LOG", "warn"));
    let (_, policy) = tasks(&server).swap_remove(2);
    let mut policy = policy;
    policy["steps"] = json!(10_000_000);
    policy["checkpoint_every"] = json!(2000);
    let id = server.create_job("policy.train", policy);
    server.wait_for_progress(&id);

    let paths = ["/jobs".to_owned(), format!("/jobs/{id}"), format!("/jobs/{id}/events?limit=20")];
    let (is_over, times) = (AtomicBool::new(false), Mutex::new(Vec::new()));
    let received = Mutex::new(Vec::new());
    let mut memory = Vec::new();
    std::thread::scope(|scope| {
        for reader in 0..READERS {
            let (server, paths, is_over, times) = (&server, &paths, &is_over, &times);
            scope.spawn(move || {
                let agent = ureq::Agent::new_with_defaults();
                let mut durations = Vec::new();
                for path in paths.iter().cycle().skip(reader) {
                    if is_over.load(Ordering::Relaxed) {
                        break;
                    }
                    let start = Instant::now();
                    let mut response =
                        agent.get(format!("{}/api/v1{path}", server.url)).call().unwrap();
                    response.body_mut().read_to_string().unwrap();
                    durations.push(start.elapsed().as_secs_f64());
                    std::thread::sleep(PAUSE);
                }
                times.lock().unwrap().extend(durations);
            });
        }
        for _ in 0..SUBSCRIBERS {
            let url = format!("{}/api/v1/jobs/{id}/stream", server.url);
            let received = &received;
            scope.spawn(move || {
                let response = ureq::get(url).call().unwrap().into_body();
                let lines = BufReader::new(response.into_reader()).lines();
                let ids = lines.map_while(Result::ok).filter(|line| line.starts_with("id: "));
                received.lock().unwrap().push(ids.collect::<Vec<_>>());
            });
        }
        let start = Instant::now();
        while start.elapsed().as_secs() < seconds {
            std::thread::sleep(Duration::from_secs(seconds.div_ceil(20)));
            memory.push(resident(server.pid()));
        }
        is_over.store(true, Ordering::Relaxed);
        server.post(&format!("/jobs/{id}/cancel"), &json!({}));
        server.wait_for(&id, "cancelled");
    });
    let received = received.into_inner().unwrap();
    println!("{} events to each of {SUBSCRIBERS} subscribers", received[0].len());
    let all: Vec<String> =
        server.events(&id).iter().map(|event| format!("id: {}", event["seq"])).collect();
    assert!(received.iter().all(|ids| ids[..all.len()] == all), "a subscriber missed events");
    let mut times = times.into_inner().unwrap();
    times.sort_by(f64::total_cmp);
    let quantile = |q: f64| 1e3 * times[(q * (times.len() - 1) as f64) as usize];
    println!(
        "{} responses to {READERS} readers in {seconds} s: median {:.1} ms, p99 {:.1} ms, max {:.1} ms",
        times.len(),
        quantile(0.5),
        quantile(0.99),
        quantile(1.0)
    );
    let megabytes: Vec<u64> = memory.iter().map(|bytes| bytes / 1_000_000).collect();
    println!("memory of the server (MB): {megabytes:?}");
    assert!(quantile(0.99) < 50.0, "{}", quantile(0.99));
    let (quarter, last) = (memory[memory.len() / 4], memory[memory.len() - 1]);
    // Growth of less than one model: a training leaves nothing in memory.
    assert!(last < quarter + 8_000_000, "{megabytes:?}");

    let url = format!("{}/api/v1/models/default/weights", server.url);
    let agent = ureq::Agent::new_with_defaults();
    let mut rates = Vec::new();
    for _ in 0..40 {
        let start = Instant::now();
        let mut response = agent.get(&url).call().unwrap();
        // The default body limit of the client is smaller than the weights.
        let read = response.body_mut().with_config().limit(1 << 30).read_to_vec().unwrap();
        rates.push(read.len() as f64 / start.elapsed().as_secs_f64() / 1e6);
    }
    rates.sort_by(f64::total_cmp);
    println!("weights: {:.0} MB/s (median of 40)", rates[20]);
    assert!(rates[20] > 500.0, "{rates:?}");
}

/// OBJ source of a right-angled tetrahedron with this height (m).
pub(crate) fn tetrahedron(height: f64) -> String {
    format!("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 {height}\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
}

#[test]
#[ignore = "a minute: cargo xtask stress"]
fn ten_thousand_small_uploads_are_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let mut serve = Command::new(env!("CARGO_BIN_EXE_ngf"));
    serve.args(["serve", "--port", "0", "--max-writes-per-second", "1000000", "--data-dir"]);
    serve.arg(folder.path().join("data")).env("NGF_LOG", "warn");
    let server = Server::spawn(&mut serve);
    let (agent, start) = (ureq::Agent::new_with_defaults(), Instant::now());
    let mut before = 0;
    for number in 0..10_000_u32 {
        if number == 1000 {
            before = resident(server.pid());
        }
        let mesh = tetrahedron(0.1 + f64::from(number) * 1e-5);
        let url = format!("{}/api/v1/meshes?name={number}.obj", server.url);
        assert_eq!(agent.post(url).send(&mesh).unwrap().status(), 201);
    }
    let (seconds, after) = (start.elapsed().as_secs_f64(), resident(server.pid()));
    println!(
        "10,000 meshes in {seconds:.0} s; memory {} MB, then {} MB",
        before >> 20,
        after >> 20
    );
    assert_eq!(server.get("/meshes?limit=100")["data"].as_array().unwrap().len(), 100);
    assert!(after < 2 * before, "{before} {after}");
}

/// Binary STL file with separate triangles.
fn loose_triangles(count: u32, offset: f32) -> Vec<u8> {
    let mut stl = vec![0; 80];
    stl.extend(count.to_le_bytes());
    for number in 0..count {
        let [x, y, z] =
            [number % 100, number / 100 % 100, number / 10_000].map(|n| n as f32 + offset);
        let corners = [[0.0, 0.0, 1.0], [x, y, z], [x + 0.5, y, z], [x, y + 0.5, z + 0.1]];
        stl.extend(corners.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
        stl.extend([0, 0]);
    }
    stl
}

#[test]
#[ignore = "half a minute: cargo xtask stress"]
fn memory_is_returned_after_large_uploads() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("data"));
    let before = resident(server.pid());
    std::thread::scope(|scope| {
        for number in 0..4_u8 {
            let url = format!("{}/api/v1/meshes", server.url);
            let mesh = loose_triangles(400_000, 0.01 * f32::from(number));
            scope.spawn(move || assert_eq!(ureq::post(url).send(&mesh).unwrap().status(), 201));
        }
    });
    std::thread::sleep(Duration::from_secs(20));
    let after = resident(server.pid());
    println!("memory: {} MB, after four meshes of 20 MB {} MB", before >> 20, after >> 20);
    assert!(after < before + 100_000_000, "{before} {after}");
}

#[test]
#[ignore = "half a minute: cargo xtask stress"]
fn stalled_request_bodies_time_out() {
    let folder = tempfile::tempdir().unwrap();
    let mut serve = Command::new(env!("CARGO_BIN_EXE_ngf"));
    serve.args(["serve", "--port", "0", "--max-writes-per-second", "1000000", "--data-dir"]);
    let server = Server::spawn(serve.arg(folder.path().join("data")));
    let address = server.url.strip_prefix("http://").unwrap();
    let mut slow: Vec<TcpStream> = (0..100)
        .map(|_| {
            let mut stream = TcpStream::connect(address).unwrap();
            let head =
                "POST /api/v1/meshes HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\nv 0";
            stream.write_all(head.as_bytes()).unwrap();
            stream
        })
        .collect();
    // Stalled bodies do not delay other requests.
    let start = Instant::now();
    server.get("/meshes");
    assert!(start.elapsed() < Duration::from_millis(500), "{:?}", start.elapsed());
    for stream in &mut slow {
        stream.set_read_timeout(Some(Duration::from_secs(45))).unwrap();
        let mut response = [0; 1000];
        let read = stream.read(&mut response).unwrap();
        let response = String::from_utf8_lossy(&response[..read]).into_owned();
        assert!(
            response.starts_with("HTTP/1.1 400") && response.contains("incomplete_body"),
            "{response}"
        );
    }
}
