//! The documentation of the API: it has every request, and its examples do what they say.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

const API: &str = include_str!("../../../docs/api.md");

#[test]
fn every_request_is_documented() {
    let described = serde_json::to_value(server::openapi()).unwrap();
    let described: BTreeSet<String> = described["paths"]
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
    assert_eq!(headings.collect::<BTreeSet<_>>(), described);
    // Each has an example.
    for section in API.split("\n### ").skip(1) {
        assert!(section.contains("```sh\n"), "{}", section.lines().next().unwrap());
    }
}

#[test]
fn every_kind_of_job_is_asked_for_once() {
    let described = serde_json::to_value(server::openapi()).unwrap();
    let tasks = described["components"]["schemas"]["JobTask"]["oneOf"].as_array().unwrap();
    assert_eq!(tasks.len(), 5);
    for task in tasks {
        let kind = task["properties"]["kind"]["enum"][0].as_str().unwrap();
        let asks = |quote: &str| API.contains(&format!("{quote}kind{quote}: {quote}{kind}{quote}"));
        assert!(asks("\"") || asks("\\\""), "{kind}");
    }
}

#[test]
fn every_example_does_what_it_says() {
    let folder = tempfile::tempdir().unwrap();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let mut server = Command::new(env!("CARGO_BIN_EXE_ngf"))
        .args(["serve", "--port", "0", "--data"])
        .arg(folder.path().join("data"))
        .arg("--models")
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
    let said = String::from_utf8_lossy(&ran.stdout).into_owned();
    let errors = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(ran.status.success(), "{said}\n{errors}");
    for text in [
        "\"like_job_id\":null",
        "event: done",
        "\"code\":\"not_its_turn\"",
        "\"watertight\":true",
        "ngf_jobs{",
    ] {
        assert!(said.contains(text), "{text}\n{said}\n{errors}");
    }
    let made = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(made("wedge.obj"), made("again.obj"));
    assert_eq!(made("header").len(), 8);
    assert!(made("demonstration.json").starts_with(b"{"));
}
