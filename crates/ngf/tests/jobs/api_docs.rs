//! The API documentation covers every request, and its examples work.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

const API: &str = include_str!("../../../../docs/api.md");

#[test]
fn every_endpoint_is_documented() {
    let openapi = serde_json::to_value(server::openapi()).unwrap();
    let endpoints: BTreeSet<String> = openapi["paths"]
        .as_object()
        .unwrap()
        .iter()
        .flat_map(|(path, item)| {
            let path = path.strip_prefix("/api/v1").filter(|rest| !rest.is_empty()).unwrap_or(path);
            let methods = ["get", "post", "put", "patch", "delete"];
            let has = |method: &&str| item[*method].is_object();
            methods.into_iter().filter(has).map(move |m| format!("{} {path}", m.to_uppercase()))
        })
        .collect();
    let headings = API.lines().filter_map(|line| line.strip_prefix("### ")).map(str::to_owned);
    assert_eq!(headings.collect::<BTreeSet<_>>(), endpoints);
    // Each section has an example.
    for section in API.split("\n### ").skip(1) {
        assert!(section.contains("```sh\n"), "{}", section.lines().next().unwrap());
    }
}

#[test]
fn every_job_kind_has_an_example() {
    let openapi = serde_json::to_value(server::openapi()).unwrap();
    let request = &openapi["components"]["schemas"]["JobRequest"];
    let kinds = request["discriminator"]["mapping"].as_object().unwrap();
    assert!(!kinds.is_empty());
    for kind in kinds.keys() {
        let has_example =
            |quote: &str| API.contains(&format!("{quote}kind{quote}: {quote}{kind}{quote}"));
        assert!(has_example("\"") || has_example("\\\""), "{kind}");
    }
}

#[test]
fn every_example_runs() {
    let folder = tempfile::tempdir().unwrap();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let mut server = Command::new(env!("CARGO_BIN_EXE_ngf"))
        .args(["serve", "--port", "0", "--data-dir"])
        .arg(folder.path().join("data"))
        .arg("--models-dir")
        .arg(models)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut url = String::new();
    BufReader::new(server.stdout.take().unwrap()).read_line(&mut url).unwrap();
    let blocks = API.split("```sh\n").skip(1).map(|rest| rest.split("```").next().unwrap());
    let script: Vec<&str> = blocks.collect();
    let ran = Command::new("bash")
        .args(["-euxo", "pipefail", "-c", &script.join("\n")])
        .env("api", format!("{}/api/v1", url.trim()))
        .current_dir(folder.path())
        .output()
        .unwrap();
    server.kill().unwrap();
    server.wait().unwrap();
    let stdout = String::from_utf8_lossy(&ran.stdout).into_owned();
    let errors = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(ran.status.success(), "{stdout}\n{errors}");
    for text in [
        "\"based_on_job_id\":null",
        "event: done",
        "\"code\":\"stale_worker\"",
        "\"watertight\":true",
        "ngf_jobs{",
    ] {
        assert!(stdout.contains(text), "{text}\n{stdout}\n{errors}");
    }
    let file = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(file("wedge.obj"), file("again.obj"));
    assert_eq!(file("header").len(), 8);
    assert!(file("demonstration.json").starts_with(b"{"));
}
