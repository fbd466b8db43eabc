//! Checks of the HTTP API with programs of others: validators, a fuzzer, and a generated client.

use crate::workspace::{Workspace, run};
use crate::{python, tools};
use anyhow::{Context, Result};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};

/// The OpenAPI description in the repository.
const DESCRIPTION: &str = "server/openapi.json";

/// A server; ends when it is dropped.
struct Server {
    process: Child,
    /// Address, such as `http://127.0.0.1:8787`.
    url: String,
}

impl Server {
    /// Starts a server on a free port, with a new data folder.
    fn start(workspace: &Workspace, data: &Path, options: &[&str]) -> Result<Self> {
        if data.exists() {
            std::fs::remove_dir_all(data)?;
        }
        let serve = ["serve", "--port", "0", "--max-writes-per-second", "100000"];
        let mut serve = workspace.command(workspace.program("ngf"), &serve);
        serve.args(options).arg("--data-dir").arg(data);
        serve.env("NGF_LOG", "warn").stdout(Stdio::piped());
        let mut server =
            Self { process: serve.spawn().context("cannot run ngf")?, url: String::new() };
        if let Some(output) = server.process.stdout.take() {
            BufReader::new(output).read_line(&mut server.url)?;
        }
        server.url = server.url.trim().to_owned();
        Ok(server)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

/// Validates the OpenAPI description, and the metrics of a server.
pub(crate) fn validate(workspace: &Workspace) -> Result<()> {
    let python = python::environment(workspace, python::TEST)?;
    run(&mut workspace.command(&python, &["-m", "openapi_spec_validator", DESCRIPTION]))?;
    // The server accepts jobs but does not start them.
    let data = workspace.target.join("tmp/metrics");
    let server = Server::start(workspace, &data, &["--max-jobs", "0"])?;
    run(workspace.command(&python, &["tests/python/metrics.py"]).arg(&server.url))
}

/// Lints the OpenAPI description.
pub(crate) fn lint(workspace: &Workspace) -> Result<()> {
    tools::node(workspace)?;
    let folder = workspace.browser_tests();
    tools::npm_packages(workspace, "browser-packages", &folder)?;
    run(&mut workspace.npm(&folder, &["run", "--silent", "api-lint"]))
}

/// Sends valid and invalid requests, generated from the OpenAPI description. Fails if a response does not
/// conform to the description or is a server error.
pub(crate) fn fuzz(workspace: &Workspace) -> Result<()> {
    let python = python::environment(workspace, python::API)?;
    workspace.build_programs(&["ngf", "ngf-worker"])?;
    // The server accepts jobs but does not start them.
    let data = workspace.target.join("tmp/api");
    let server = Server::start(workspace, &data, &["--max-jobs", "0"])?;
    let checks = "not_a_server_error,status_code_conformance,content_type_conformance,\
                  response_schema_conformance,negative_data_rejection";
    let description = format!("{}/openapi.json", server.url);
    let program = python.with_file_name("schemathesis");
    let mut schemathesis = workspace.command(program, &["run", &description]);
    schemathesis.args([
        "--phases",
        "coverage,fuzzing",
        "--continue-on-failure",
        "--warnings",
        "off",
    ]);
    schemathesis.args(["--checks", checks, "--max-time", "300", "--seed", "1"]);
    run(&mut schemathesis)
}

/// Folder of the dataset that the generated client fetched.
pub(crate) fn fetched_dataset(workspace: &Workspace) -> PathBuf {
    workspace.target.join("tmp/fetched-dataset")
}

/// Generates a Python client from the OpenAPI description and runs the pipeline with it: dataset, encoder,
/// policy, evaluation. Downloads the dataset to [`fetched_dataset`].
pub(crate) fn run_generated_client(workspace: &Workspace) -> Result<()> {
    let python = python::environment(workspace, python::CLIENTS)?;
    let client = workspace.target.join("tmp/python-client");
    let mut generate =
        workspace.command(python.with_file_name("openapi-python-client"), &["generate"]);
    generate.args(["--path", DESCRIPTION, "--meta", "none", "--fail-on-warning", "--overwrite"]);
    generate.arg("--output-path").arg(client.join("ngf_grasp_client"));
    // The generator formats its code with a program of its own environment.
    let path = std::env::var_os("PATH").unwrap_or_default();
    let bin = python.parent().map(Path::to_owned);
    let path = std::env::join_paths(bin.into_iter().chain(std::env::split_paths(&path)))?;
    run(generate.env("PATH", path))?;
    let server = Server::start(workspace, &workspace.target.join("tmp/clients"), &[])?;
    let mut pipeline =
        workspace.command(python, &["tests/python/generated_client.py", &server.url]);
    run(pipeline.arg(fetched_dataset(workspace)).env("PYTHONPATH", client))
}
