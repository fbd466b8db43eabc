//! A disk that is full while jobs run: a small memory file system, where the tests may mount one.

use crate::server::Server;
use serde_json::json;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Unmounts the file system when dropped.
struct Mounted<'a>(&'a Path);

impl Drop for Mounted<'_> {
    fn drop(&mut self) {
        // Open files of the server do not prevent a lazy unmount.
        Command::new("umount").arg("-l").arg(self.0).status().ok();
    }
}

/// Mounts 24 MB of memory; `None`, with a message, without the permission to do so.
fn mount(folder: &Path) -> Option<Mounted<'_>> {
    let mut mount = Command::new("mount");
    let output = mount.args(["-t", "tmpfs", "-o", "size=24m", "tmpfs"]).arg(folder).output();
    let reason = match output {
        Ok(output) if output.status.success() => return Some(Mounted(folder)),
        Ok(output) => String::from_utf8_lossy(&output.stderr).into_owned(),
        Err(error) => error.to_string(),
    };
    println!("skipped: cannot mount a tmpfs: {reason}");
    None
}

#[test]
#[ignore = "a minute: cargo xtask stress"]
fn jobs_that_end_on_a_full_disk_are_recorded_once_there_is_space() {
    let folder = tempfile::tempdir().unwrap();
    let Some(disk) = mount(folder.path()) else { return };
    let mut serve = Command::new(env!("CARGO_BIN_EXE_ngf"));
    serve.args(["serve", "--port", "0", "--min-free-gb", "0", "--data-dir"]);
    let server = Server::spawn(serve.arg(disk.0.join("data")).env("NGF_LOG", "warn"));
    let dataset = server.create_job("dataset.generate", json!({ "preset": "smoke" }));
    let dataset = server.wait_for(&dataset, "succeeded")["outputs"]["dataset_id"].clone();
    let training = json!({ "dataset_id": dataset, "preset": "smoke" });
    for (kind, params) in
        [("encoder.train", training), ("dataset.generate", json!({ "preset": "smoke", "seed": 2 }))]
    {
        let id = server.create_job(kind, params);
        server.wait(&id, |job| job["status"] == "running");
        let filler = disk.0.join("filler");
        let mut file = std::fs::File::create(&filler).unwrap();
        while file.write_all(&[0; 4096]).is_ok() {}
        // An open file keeps its space after it is removed.
        drop(file);
        std::thread::sleep(Duration::from_secs(15));
        let agent = ureq::Agent::config_builder().http_status_as_error(false).build().new_agent();
        for _ in 0..3 {
            let request = json!({ "kind": "dataset.generate" });
            let url = format!("{}/api/v1/jobs", server.url);
            assert_eq!(agent.post(url).send_json(&request).unwrap().status().as_u16(), 507);
        }
        let ready = agent.get(format!("{}/readyz", server.url)).call().unwrap();
        assert_eq!(ready.status().as_u16(), 503);
        std::fs::remove_file(filler).unwrap();
        let is_over = |job: &serde_json::Value| job["finished_at"].is_string();
        let job = server.wait(&id, is_over);
        println!("{kind}: {} in attempt {}: {}", job["status"], job["attempt"], job["error"]);
        // A job that itself needs the full disk fails with this reason; its retry succeeds.
        if job["status"] == "failed" {
            let reason = job["error"]["message"].as_str().unwrap();
            assert!(reason.contains("No space left"), "{job}");
            server.post(&format!("/jobs/{id}/retry"), &json!({}));
            server.wait_for(&id, "succeeded");
        }
        server.get_path("/readyz");
    }
}
