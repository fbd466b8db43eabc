//! `check` and `test`: stages one after the other, and the count of their test cases.

use crate::chromium;
use crate::place::{Place, name, run};
use crate::tally::Tally;
use crate::{demo, python, tools};
use anyhow::{Context, Result};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Members that do not take part in native builds: one runs in the browser, one runs it there.
const NOT_NATIVE: [&str; 4] = ["--exclude", "wasm", "--exclude", "wasm-test-runner"];

/// Seconds for a test in the browser; the runner's own limit of 20 is for unit tests.
const WASM_TEST_SECONDS: &str = "300";

/// The same for a proof.
const PROOF_SECONDS: &str = "3600";

/// What Python needs, a file in tests/python.
const PYTHON: &str = "requirements.txt";
const PYTHON_OF_REQUESTS: &str = "requests.txt";

/// What ran so far.
struct Stages {
    tally: Tally,
    failed: Vec<&'static str>,
    begin: Instant,
}

/// Format, lints, quick tests and types. `Ok(false)` if any of them failed.
pub(crate) fn check(place: &Place) -> Result<bool> {
    let mut stages = Stages::new();
    quick(place, &mut stages);
    Ok(stages.report())
}

/// All of `check`, then what runs in the browser, then the documentation.
pub(crate) fn test(place: &Place) -> Result<bool> {
    // What is missing is told before anything that takes minutes.
    tools::node(place)?;
    chromium::find(place)?;
    python::environment(place, PYTHON)?;
    let mut stages = Stages::new();
    quick(place, &mut stages);
    stages.stage("python", |stages| stages.count(&mut python_tests(place)?));
    stages.stage("wasm", |stages| {
        let mut tests = wasm_tests(place)?;
        stages.count(tests.args(["--lib", "--tests"]))
    });
    stages.stage("browser", |stages| {
        demo::build(place)?;
        stages.count(&mut tools::browser(place, "test")?)
    });
    stages.stage("docs", |_| {
        let args = ["doc", "-q", "--workspace", "--no-deps", "--exclude", "wasm-test-runner"];
        run(place.cargo(&args).env("RUSTDOCFLAGS", "-D warnings"))
    });
    Ok(stages.report())
}

/// What takes too long for every change.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Proof {
    /// A hundred attempts in the browser, bit for bit as natively.
    Attempts,
    /// Violent ends of jobs, a crowd of readers, ten thousand uploads, bodies that never end.
    Jobs,
    /// Requests of every kind.
    Requests,
    /// Mutated meshes, weights, recordings and jobs.
    Fuzz,
}

/// Some of the proofs, or all if none is named.
pub(crate) fn prove(place: &Place, named: &[Proof]) -> Result<bool> {
    let wanted = |proof| named.is_empty() || named.contains(&proof);
    if wanted(Proof::Attempts) {
        chromium::find(place)?;
    }
    if wanted(Proof::Requests) {
        python::environment(place, PYTHON_OF_REQUESTS)?;
    }
    let mut stages = Stages::new();
    if wanted(Proof::Attempts) {
        stages.stage("attempts in the browser", |stages| {
            let mut tests = wasm_tests(place)?;
            tests.args(["--test", "attempts", "--", "--nocapture"]);
            tests.env("NGF_ATTEMPTS", "50").env("WASM_BINDGEN_TEST_TIMEOUT", PROOF_SECONDS);
            stages.count(&mut tests)
        });
    }
    if wanted(Proof::Jobs) {
        stages.stage("jobs", |stages| {
            let proofs = ["test", "--workspace", "--no-fail-fast", "--test", "jobs"];
            let mut cargo = place.cargo(&proofs);
            cargo.args(NOT_NATIVE).args(["--", "--ignored", "--nocapture", "--test-threads", "1"]);
            stages.count(&mut cargo)
        });
    }
    if wanted(Proof::Requests) {
        stages.stage("requests", |_| requests(place));
    }
    if wanted(Proof::Fuzz) {
        stages.stage("fuzz", |_| fuzz(place));
    }
    Ok(stages.report())
}

/// Requests of all kinds, good and bad, made from the description of the API: none is answered otherwise than described,
/// none by a failure of the server.
fn requests(place: &Place) -> Result<()> {
    let python = python::environment(place, PYTHON_OF_REQUESTS)?;
    run(&mut place.cargo(&["build", "-q", "-p", "ngf"]))?;
    let folder = place.target.join("tmp/requests");
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    // Jobs are taken, and none begins.
    let serve = ["serve", "--port", "0", "--places", "0", "--rate", "100000", "--data"];
    let mut serve = place.command(place.program("ngf"), &serve);
    serve.arg(&folder).env("NGF_LOG", "warn").stdout(Stdio::piped());
    let mut server = serve.spawn().context("cannot run ngf")?;
    let mut address = String::new();
    if let Some(said) = server.stdout.take() {
        BufReader::new(said).read_line(&mut address)?;
    }
    let checks = "not_a_server_error,status_code_conformance,content_type_conformance,\
                  response_schema_conformance,negative_data_rejection";
    let description = format!("{}/openapi.json", address.trim());
    let mut ask = place.command(python.with_file_name("schemathesis"), &["run", &description]);
    ask.args(["--phases", "coverage,fuzzing", "--continue-on-failure", "--warnings", "off"]);
    ask.args(["--checks", checks, "--max-time", "300", "--seed", "1"]);
    let asked = run(&mut ask);
    server.kill()?;
    server.wait()?;
    asked
}

/// Minutes that each target of `fuzz/` is given.
const FUZZ_MINUTES: u32 = 10;

/// Mutates what strangers may send: meshes, weights, what plays, requests for jobs.
fn fuzz(place: &Place) -> Result<()> {
    // libFuzzer finds its way by counters at the edges of the code; these flags are those of cargo-fuzz, which needs a
    // nightly compiler only for the sanitizers.
    let flags = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
                 -Cllvm-args=-sanitizer-coverage-pc-table -Ccodegen-units=1";
    let folder = place.target.join("fuzz");
    let target = folder.to_string_lossy();
    // Named, so that build scripts and macros, which run here, are not instrumented.
    let machine = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let build = ["build", "-p", "fuzz", "--features", "fuzzer", "--bins", "--target-dir", &target];
    run(place.cargo(&build).args(["--target", &machine]).env("RUSTFLAGS", flags))?;
    for name in ["mesh", "weights", "tape", "job"] {
        let found = folder.join("corpus").join(name);
        std::fs::create_dir_all(&found)?;
        let program = folder.join(&machine).join("debug").join(format!("fuzz-{name}"));
        let mut fuzzing = place.command(program, &["-timeout=10", "-rss_limit_mb=4096"]);
        fuzzing.arg(format!("-max_total_time={}", 60 * FUZZ_MINUTES));
        // What breaks it is left in the folder.
        fuzzing.arg(format!("-artifact_prefix={}/", folder.display()));
        run(fuzzing.arg(found).arg(place.root.join("fuzz/corpus").join(name)))?;
    }
    Ok(())
}

fn quick(place: &Place, stages: &mut Stages) {
    stages.stage("format", |_| run(&mut place.cargo(&["fmt", "--all", "--check"])));
    stages.stage("lints", |_| {
        let mut clippy = place.cargo(&["clippy", "-q", "--workspace", "--all-targets"]);
        run(clippy.args(["--exclude", "wasm-test-runner", "--", "-D", "warnings"]))
    });
    stages.stage("native", |stages| {
        let mut cargo = place.cargo(&["test", "--workspace", "--no-fail-fast"]);
        stages.count(cargo.args(NOT_NATIVE))
    });
    stages.stage("types", |_| {
        tools::node(place)?;
        tools::npm_packages(place, "packages", &place.web())?;
        run(&mut place.npm(&place.web(), &["run", "--silent", "typecheck"]))
    });
}

/// A small dataset, read from Python.
fn python_tests(place: &Place) -> Result<Command> {
    let python = python::environment(place, PYTHON)?;
    run(&mut place.cargo(&["build", "-q", "-p", "ngf"]))?;
    let folder = place.target.join("tmp/dataset");
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    let make = ["dataset", "--preset", "smoke", "--out"];
    run(place.command(place.program("ngf"), &make).arg(&folder))?;
    let mut read = place.command(python, &["tests/python/read_dataset.py"]);
    read.arg(folder).arg("README.md");
    Ok(read)
}

/// The tests of the worker's crate, in headless Chromium.
fn wasm_tests(place: &Place) -> Result<Command> {
    let chromium = chromium::find(place)?;
    tools::wasm_target(place)?;
    run(&mut place.cargo(&["build", "-q", "-p", "wasm-test-runner"]))?;
    let runner = place.program("wasm-test-runner");
    let mut cargo = place.cargo(&["test", "-p", "wasm", "--target", "wasm32-unknown-unknown"]);
    cargo
        .arg("--no-fail-fast")
        .env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUNNER", runner)
        .env("CHROMEDRIVER", chromium.driver)
        .env("WASM_BINDGEN_TEST_TIMEOUT", WASM_TEST_SECONDS);
    Ok(cargo)
}

impl Stages {
    fn new() -> Self {
        Self { tally: Tally::default(), failed: Vec::new(), begin: Instant::now() }
    }

    /// Runs one stage; a failure is told and kept, and the others still run.
    fn stage(&mut self, name: &'static str, work: impl FnOnce(&mut Self) -> Result<()>) {
        println!("\n--- {name}");
        let begin = Instant::now();
        match work(self) {
            Ok(()) => println!("{name}: {:.1} s", begin.elapsed().as_secs_f32()),
            Err(error) => {
                println!("{name}: failed: {error:#}");
                self.failed.push(name);
            }
        }
    }

    /// Runs a command, passing its output on and counting the test cases in it.
    fn count(&mut self, command: &mut Command) -> Result<()> {
        let mut child = command
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot run {}", name(command)))?;
        let output = child.stdout.take().context("a pipe")?;
        for line in BufReader::new(output).split(b'\n') {
            let line = line?;
            let line = String::from_utf8_lossy(&line);
            println!("{line}");
            self.tally += Tally::of_line(&line);
        }
        let status = child.wait()?;
        anyhow::ensure!(status.success(), "`{}` failed ({status})", name(command));
        Ok(())
    }

    /// The last line: how many test cases passed and failed, and which stages did.
    fn report(&self) -> bool {
        let Tally { passed, failed } = self.tally;
        let seconds = self.begin.elapsed().as_secs_f32();
        let stages = match self.failed.as_slice() {
            [] => "all stages passed".to_owned(),
            failed => format!("stages that failed: {}", failed.join(", ")),
        };
        println!("\n{passed} passed, {failed} failed; {stages} ({seconds:.0} s)");
        failed == 0 && self.failed.is_empty()
    }
}
