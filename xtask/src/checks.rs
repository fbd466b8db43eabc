//! `check`, `test` and `stress`: run stages in sequence and count the test cases.

use crate::chromium;
use crate::stages::StageRunner;
use crate::workspace::{Workspace, run};
use crate::{api_checks, demo, engines, python, tools, web_build};
use anyhow::Result;
use std::path::PathBuf;
use std::process::Command;

/// Time limit of a browser test (s). The default of the runner, 20 s, is for unit tests.
const WASM_TEST_SECONDS: &str = "300";

/// Time limit of a long browser test (s).
const LONG_TEST_SECONDS: &str = "3600";

/// Examples that run without arguments. The native tests build them.
const EXAMPLES: [&str; 5] = [
    "01_forward_kinematics",
    "02_fabric_plan",
    "03_import_mesh",
    "04_grasp_search",
    "05_run_policy",
];

/// Runs format, spelling, licences, lints, native tests and types. `Ok(false)` if any stage failed.
pub(crate) fn check(workspace: &Workspace) -> Result<bool> {
    let mut stages = StageRunner::new();
    quick(workspace, &mut stages);
    Ok(stages.report())
}

/// Runs `check`, then Python, browser and documentation stages.
pub(crate) fn test(workspace: &Workspace) -> Result<bool> {
    // Missing tools are reported before stages that take minutes.
    tools::node(workspace)?;
    chromium::find(workspace)?;
    python::environment(workspace, python::TEST)?;
    let mut stages = StageRunner::new();
    quick(workspace, &mut stages);
    stages.stage("python", |stages| {
        stages.count(&mut python_tests(workspace)?)?;
        let python = python::environment(workspace, python::TEST)?;
        let example = ["examples/06_read_dataset.py"];
        run(workspace.command(python, &example).arg(dataset_folder(workspace)))
    });
    stages.stage("api", |_| api_checks::validate(workspace));
    stages.stage("wasm", |stages| {
        let mut tests = wasm_tests(workspace)?;
        stages.count(tests.args(["--lib", "--tests"]))
    });
    stages.stage("browser", |stages| {
        // The native tests have built the server. Another build with `-p ngf` would select other features of
        // the dependencies and compile them again.
        tools::wasm_target(workspace)?;
        web_build::build(workspace)?;
        stages.count(&mut tools::browser(workspace, "test")?)
    });
    stages.stage("examples", |_| EXAMPLES.iter().try_for_each(|name| run_example(workspace, name)));
    stages.stage("docs", |_| {
        let args = ["doc", "-q", "--workspace", "--no-deps"];
        run(workspace.cargo(&args).env("RUSTDOCFLAGS", "-D warnings"))
    });
    Ok(stages.report())
}

/// Checks that take too long for every change.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum LongCheck {
    /// Compare 100 attempts in the browser with native ones, bit for bit.
    Parity,
    /// Run attempts in Firefox and WebKitGTK, and compare them with native ones, bit for bit.
    Engines,
    /// Kill workers and servers, 100 concurrent readers, 10,000 uploads, stalled request bodies.
    Jobs,
    /// Lint the OpenAPI description, and fuzz the HTTP API from it.
    Api,
    /// Run the pipeline with a generated Python client, and train LeRobot's policies on its dataset.
    Clients,
    /// Fuzz the parsers of meshes, weights, replay files and job requests.
    Fuzz,
}

/// Runs the selected long checks, or all if none is selected.
pub(crate) fn stress(workspace: &Workspace, selection: &[LongCheck]) -> Result<bool> {
    let is_selected = |check| selection.is_empty() || selection.contains(&check);
    if is_selected(LongCheck::Parity) {
        chromium::find(workspace)?;
    }
    if is_selected(LongCheck::Api) {
        python::environment(workspace, python::API)?;
    }
    if is_selected(LongCheck::Clients) {
        python::environment(workspace, python::CLIENTS)?;
        python::environment(workspace, python::LEROBOT)?;
    }
    let mut stages = StageRunner::new();
    if is_selected(LongCheck::Parity) {
        stages.stage("browser parity", |stages| {
            let mut tests = wasm_tests(workspace)?;
            tests.args(["--test", "attempts", "--", "--nocapture"]);
            tests.env("NGF_ATTEMPTS", "50").env("WASM_BINDGEN_TEST_TIMEOUT", LONG_TEST_SECONDS);
            stages.count(&mut tests)
        });
    }
    if is_selected(LongCheck::Engines) {
        stages.stage("engines", |stages| {
            demo::build(workspace)?;
            stages.count(&mut engines::command(workspace)?)
        });
    }
    if is_selected(LongCheck::Jobs) {
        stages.stage("jobs", |stages| {
            let test = ["test", "--workspace", "--no-fail-fast", "--test", "jobs"];
            let mut cargo = workspace.cargo(&test);
            cargo.args(["--", "--ignored", "--nocapture", "--test-threads", "1"]);
            stages.count(&mut cargo)
        });
    }
    if is_selected(LongCheck::Api) {
        stages.stage("api lint", |_| api_checks::lint(workspace));
        stages.stage("api", |_| api_checks::fuzz(workspace));
    }
    if is_selected(LongCheck::Clients) {
        stages.stage("clients", |_| {
            workspace.build_programs(&["ngf", "ngf-worker"])?;
            api_checks::run_generated_client(workspace)
        });
        stages.stage("lerobot", |stages| {
            let python = python::environment(workspace, python::LEROBOT)?;
            let mut test = workspace.command(python, &["tests/python/lerobot_training.py"]);
            stages.count(test.arg(api_checks::fetched_dataset(workspace)))
        });
    }
    if is_selected(LongCheck::Fuzz) {
        stages.stage("fuzz", |_| fuzz(workspace));
    }
    Ok(stages.report())
}

/// Fuzzing time of each target in `fuzz/` (minutes).
const FUZZ_MINUTES: u32 = 10;

/// Fuzzes the parsers of untrusted input: meshes, weights, replay files, job requests.
fn fuzz(workspace: &Workspace) -> Result<()> {
    // libFuzzer is guided by edge counters. These are the flags of cargo-fuzz, which requires a nightly
    // compiler only for the sanitizers.
    let flags = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
                 -Cllvm-args=-sanitizer-coverage-pc-table -Ccodegen-units=1";
    let folder = workspace.target.join("fuzz");
    let target = folder.to_string_lossy();
    // With an explicit target, build scripts and macros, which run on the host, are not instrumented.
    let triple = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let build = ["build", "-p", "fuzz", "--features", "fuzzer", "--bins", "--target-dir", &target];
    run(workspace.cargo(&build).args(["--target", &triple]).env("RUSTFLAGS", flags))?;
    for name in ["mesh", "weights", "replay_file", "job"] {
        let new_inputs = folder.join("corpus").join(name);
        std::fs::create_dir_all(&new_inputs)?;
        let program = folder.join(&triple).join("debug").join(format!("fuzz-{name}"));
        let mut fuzzing = workspace.command(program, &["-timeout=10", "-rss_limit_mb=4096"]);
        fuzzing.arg(format!("-max_total_time={}", 60 * FUZZ_MINUTES));
        // Inputs that cause a crash are written to this folder.
        fuzzing.arg(format!("-artifact_prefix={}/", folder.display()));
        run(fuzzing.arg(new_inputs).arg(workspace.root.join("fuzz/corpus").join(name)))?;
    }
    Ok(())
}

fn quick(workspace: &Workspace, stages: &mut StageRunner) {
    stages.stage("format", |_| run(&mut workspace.cargo(&["fmt", "--all", "--check"])));
    stages.stage("spelling", |_| {
        let python = python::environment(workspace, python::LINTS)?;
        run(&mut workspace.command(python.with_file_name("typos"), &[]))
    });
    stages.stage("licences", |_| {
        let cargo_deny = tools::cargo_deny(workspace)?;
        let checks = ["check", "--hide-inclusion-graph", "licenses", "bans", "sources"];
        run(&mut workspace.command(cargo_deny, &checks))
    });
    stages.stage("lints", |_| {
        let mut clippy = workspace.cargo(&["clippy", "-q", "--workspace", "--all-targets"]);
        run(clippy.args(["--", "-D", "warnings"]))
    });
    stages.stage("native", |stages| {
        stages.count(&mut workspace.cargo(&["test", "--workspace", "--no-fail-fast"]))
    });
    stages.stage("types", |_| {
        tools::node(workspace)?;
        tools::npm_packages(workspace, "packages", &workspace.web())?;
        run(&mut workspace.npm(&workspace.web(), &["run", "--silent", "typecheck"]))?;
        tools::check_api_types(workspace)
    });
}

/// Folder of the dataset that the Python tests read.
fn dataset_folder(workspace: &Workspace) -> PathBuf {
    workspace.target.join("tmp/dataset")
}

/// The Python test, with a small generated dataset as input.
fn python_tests(workspace: &Workspace) -> Result<Command> {
    let python = python::environment(workspace, python::TEST)?;
    let folder = dataset_folder(workspace);
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    let generate = ["dataset", "generate", "--preset", "smoke", "--out"];
    run(workspace.command(workspace.program("ngf"), &generate).arg(&folder))?;
    let mut test = workspace.command(python, &["tests/python/read_dataset.py"]);
    test.arg(folder).arg("docs/datasets.md");
    Ok(test)
}

/// Runs one of the [`EXAMPLES`].
fn run_example(workspace: &Workspace, name: &str) -> Result<()> {
    let program = workspace.target.join("debug/examples").join(name);
    run(&mut workspace.command(program, &[]))
}

/// The tests of the browser's crates, in headless Chromium.
fn wasm_tests(workspace: &Workspace) -> Result<Command> {
    let chromium = chromium::find(workspace)?;
    tools::wasm_target(workspace)?;
    let runner = workspace.program("wasm-test-runner");
    // The native tests have built it.
    if !runner.exists() {
        workspace.build_programs(&["wasm-test-runner"])?;
    }
    let mut cargo = workspace.cargo(&["test", "-p", "wasm", "-p", "mesh-reader"]);
    cargo
        .args(["--target", "wasm32-unknown-unknown", "--no-fail-fast"])
        .env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUNNER", runner)
        .env("CHROMEDRIVER", chromium.driver)
        .env("WASM_BINDGEN_TEST_TIMEOUT", WASM_TEST_SECONDS);
    Ok(cargo)
}
