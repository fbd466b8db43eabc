//! `bench`: benchmarks of attempts, training and the web page, native and in the browser, as one table.

use crate::chromium;
use crate::workspace::{self, Workspace};
use crate::{demo, python, tools};
use anyhow::{Context, Result};
use std::path::Path;

/// One measurement, with that of a baseline if there is one.
#[derive(Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Row {
    name: String,
    value: f64,
    unit: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    baseline: Option<Baseline>,
}

/// Measurement of another program for the same task.
#[derive(Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Baseline {
    name: String,
    value: f64,
    /// Our value divided by the baseline's; the median over alternating measurements.
    ratio: f64,
    /// Min. and max. ratio over alternating measurements.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ratio_range: Option<[f64; 2]>,
}

/// Upper or lower bound of a measurement, on an otherwise idle two-core machine.
enum Budget {
    Max(f64),
    Min(f64),
}

/// Budgets of the page: latencies (ms), code size (MB) and real-time factor. The simulation clock counts
/// whole ticks and never runs ahead, so the real-time factor is slightly below 1.
const BUDGETS: [(&str, Budget); 6] = [
    ("page_first_pixels", Budget::Max(1500.0)),
    ("page_second_frame", Budget::Max(500.0)),
    ("page_code", Budget::Max(1.0)),
    ("page_real_time_factor", Budget::Min(0.98)),
    ("page_interaction_p95", Budget::Max(100.0)),
    ("page_upload_to_outcome", Budget::Max(10_000.0)),
];

/// Number of alternating measurements of our training steps and the baseline's.
const REPEATS: usize = 10;

/// Runs all benchmarks, prints the rows and writes them to `json` if given. With `baselines`, also measures
/// MuJoCo and PyTorch. Returns whether all budgets are met.
pub(crate) fn run(workspace: &Workspace, json: Option<&Path>, baselines: bool) -> Result<bool> {
    workspace.build_programs(&["ngf", "ngf-worker"])?;
    let mut rows = native(workspace, &[])?;
    rows.extend(training(workspace, baselines)?);
    if baselines {
        let mujoco = mujoco(workspace)?;
        for row in rows.iter_mut().filter(|row| row.name == "physics_step_home") {
            let (name, value) = (mujoco.name.clone(), mujoco.value);
            let ratio = row.value / value;
            row.baseline = Some(Baseline { name, value, ratio, ratio_range: None });
        }
    }
    rows.extend(in_browser(workspace)?);
    rows.extend(page(workspace)?);
    for row in &rows {
        print!("{:32} {:8.3} {:3}", row.name, row.value, row.unit);
        match &row.baseline {
            Some(Baseline { name, value, ratio, ratio_range }) => {
                let range =
                    ratio_range.map_or(String::new(), |[a, b]| format!(" ({a:.2} to {b:.2})"));
                println!(" {name} {value:.3}: ratio {ratio:.2}{range}");
            }
            None => println!(),
        }
    }
    if let Some(file) = json {
        std::fs::write(file, serde_json::to_vec_pretty(&rows)?)
            .with_context(|| format!("cannot write {}", file.display()))?;
    }
    let violations: Vec<String> =
        BUDGETS.iter().filter_map(|budget| violation(&rows, budget)).collect();
    violations.iter().for_each(|text| println!("{text}"));
    Ok(violations.is_empty())
}

/// Message if a budget is violated or its row was not measured.
fn violation(rows: &[Row], (name, budget): &(&str, Budget)) -> Option<String> {
    let Some(Row { value, unit, .. }) = rows.iter().find(|row| row.name == *name) else {
        return Some(format!("{name} was not measured"));
    };
    let (is_met, bound) = match budget {
        Budget::Max(max) => (value <= max, format!("max. {max}")),
        Budget::Min(min) => (value >= min, format!("min. {min}")),
    };
    (!is_met).then(|| format!("{name} is {value:.3} {unit}, budget {bound}"))
}

/// The rows of `ngf bench` with additional arguments.
fn native(workspace: &Workspace, args: &[&str]) -> Result<Vec<Row>> {
    let file = workspace.target.join("bench.json");
    let mut bench = workspace.command(workspace.program("ngf"), &["bench", "--quiet", "--json"]);
    workspace::run(bench.arg(&file).args(args))?;
    Ok(serde_json::from_slice(&std::fs::read(&file)?)?)
}

/// Training steps; with `baselines`, measured alternately with PyTorch.
fn training(workspace: &Workspace, baselines: bool) -> Result<Vec<Row>> {
    let mut runs = Vec::new();
    for _ in 0..if baselines { REPEATS } else { 1 } {
        let ours = native(workspace, &["--training"])?;
        runs.push((ours, if baselines { torch(workspace)? } else { Vec::new() }));
    }
    let names: Vec<String> = runs[0].0.iter().map(|row| row.name.clone()).collect();
    let value =
        |rows: &[Row], name: &str| rows.iter().find(|row| row.name == name).map(|row| row.value);
    Ok(names
        .into_iter()
        .map(|name| {
            let ours = runs.iter().filter_map(|(ours, _)| value(ours, &name)).collect();
            let baseline = format!("torch_{name}");
            let theirs: Vec<f64> =
                runs.iter().filter_map(|(_, theirs)| value(theirs, &baseline)).collect();
            let ratios = runs
                .iter()
                .filter_map(|(ours, theirs)| Some(value(ours, &name)? / value(theirs, &baseline)?));
            let mut ratios: Vec<f64> = ratios.collect();
            ratios.sort_by(f64::total_cmp);
            let baseline = (!theirs.is_empty()).then(|| Baseline {
                name: baseline,
                value: median(theirs),
                ratio_range: Some([ratios[0], ratios[ratios.len() - 1]]),
                ratio: median(ratios),
            });
            Row { name, value: median(ours), unit: "ms".into(), baseline }
        })
        .collect())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The same training steps in PyTorch, with its fastest number of threads.
fn torch(workspace: &Workspace) -> Result<Vec<Row>> {
    let python = python::environment(workspace, python::BASELINES)?;
    let script = ["tests/python/training_step.py"];
    let output = workspace::output_of(&mut workspace.command(python, &script))?;
    Ok(output.lines().filter_map(row).collect())
}

/// A MuJoCo physics step with the same robot, table and box.
fn mujoco(workspace: &Workspace) -> Result<Row> {
    let python = python::environment(workspace, python::BASELINES)?;
    let script = ["tests/python/mujoco_step.py", "assets/robot/iiwa7_allegro/robot.urdf"];
    let output = workspace::output_of(&mut workspace.command(python, &script))?;
    output.lines().find_map(row).context("mujoco_step.py printed no row")
}

/// The rows of `wasm/benches/attempt.rs`, built with the profile of the page.
fn in_browser(workspace: &Workspace) -> Result<Vec<Row>> {
    let chromium = chromium::find(workspace)?;
    tools::wasm_target(workspace)?;
    workspace.build_programs(&["wasm-test-runner"])?;
    let target = ["--target", "wasm32-unknown-unknown", "--profile", "wasm"];
    // Not `cargo bench`: the browser test runner supports neither `--bench` nor `--quiet`, which it would
    // pass.
    let mut cargo = workspace.cargo(&["test", "-p", "wasm", "--bench", "attempt"]);
    let output = workspace::output_of(
        cargo
            .args(target)
            .args(["--", "--nocapture"])
            .env(
                "CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUNNER",
                workspace.program("wasm-test-runner"),
            )
            .env("CHROMEDRIVER", chromium.driver)
            .env("WASM_BINDGEN_TEST_TIMEOUT", "300"),
    )?;
    Ok(output.lines().filter_map(row).collect())
}

/// The rows of `tests/browser/page_bench.js`, measured on the served page.
fn page(workspace: &Workspace) -> Result<Vec<Row>> {
    demo::build(workspace)?;
    let output = workspace::output_of(&mut tools::browser(workspace, "bench")?)?;
    Ok(output.lines().filter_map(row).collect())
}

/// Parses `row NAME VALUE UNIT`, with any prefix from the test runner.
fn row(line: &str) -> Option<Row> {
    let tokens: Vec<&str> = line.split_whitespace().collect();
    let at = tokens.iter().position(|token| *token == "row")?;
    let [name, value, unit] = tokens.get(at + 1..)? else { return None };
    let value = value.parse().ok()?;
    Some(Row { name: (*name).to_owned(), value, unit: (*unit).to_owned(), baseline: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn violated_or_missing_budget_is_reported() {
        let message = |line: &str, budget| violation(&[row(line).unwrap()], &("page_code", budget));
        assert_eq!(message("row page_code 0.98 MB", Budget::Max(1.0)), None);
        let over = message("row page_code 1.02 MB", Budget::Max(1.0)).unwrap();
        assert_eq!(over, "page_code is 1.020 MB, budget max. 1");
        assert!(message("row page_code 0.9 MB", Budget::Min(1.0)).unwrap().ends_with("min. 1"));
        assert!(message("row page_code NaN MB", Budget::Max(1.0)).is_some());
        let missing = message("row page_size 0.98 MB", Budget::Max(1.0));
        assert_eq!(missing.unwrap(), "page_code was not measured");
    }

    #[test]
    fn rows_are_parsed_from_runner_output() {
        let found = row("    row tick_wasm 3.25 ms").unwrap();
        assert_eq!((found.name.as_str(), found.value), ("tick_wasm", 3.25));
        assert_eq!(row("test attempt::rows ... ok"), None);
        assert_eq!(row("row without a number"), None);
    }
}
