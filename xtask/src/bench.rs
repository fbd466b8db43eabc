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
    /// Our value divided by the baseline's; the median over the turns.
    ratio: f64,
    /// Min. and max. ratio over the turns.
    ratio_range: [f64; 2],
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

/// Number of turns in which our programs and a baseline are measured.
const REPEATS: usize = 10;

/// Rows that are measured in turns with MuJoCo.
const PHYSICS_ROWS: [&str; 2] = ["physics_tick_home", "physics_tick_holding"];

/// Runs all benchmarks, prints the rows and writes them to `json` if given. With `baselines`, also measures
/// MuJoCo and PyTorch. Returns whether all budgets are met.
pub(crate) fn run(workspace: &Workspace, json: Option<&Path>, baselines: bool) -> Result<bool> {
    workspace.build_programs(&["ngf", "ngf-worker"])?;
    let state = workspace.target.join("holding_state.json");
    let path = state.to_str().context("the path of the target folder is not UTF-8")?;
    let mut rows = native(workspace, &[])?;
    rows.retain(|row| !PHYSICS_ROWS.contains(&row.name.as_str()));
    rows.extend(in_turns(
        || native(workspace, &["--physics", "--state", path]),
        baselines.then_some(Peer { name: "mujoco", measure: &|| mujoco(workspace, path) }),
    )?);
    rows.extend(in_turns(
        || native(workspace, &["--training"]),
        baselines.then_some(Peer { name: "torch", measure: &|| torch(workspace) }),
    )?);
    rows.extend(in_browser(workspace)?);
    rows.extend(page(workspace)?);
    for row in &rows {
        print!("{:32} {:8.3} {:3}", row.name, row.value, row.unit);
        match &row.baseline {
            Some(Baseline { name, value, ratio, ratio_range: [min, max] }) => {
                println!(" {name} {value:.3}: ratio {ratio:.2} ({min:.2} to {max:.2})");
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

/// Another program that measures the same tasks. Its rows have the names of ours, with a prefix.
struct Peer<'a> {
    name: &'a str,
    measure: &'a dyn Fn() -> Result<Vec<Row>>,
}

/// Medians of our rows; with a peer, measured `REPEATS` times in turns with its rows.
fn in_turns(ours: impl Fn() -> Result<Vec<Row>>, peer: Option<Peer>) -> Result<Vec<Row>> {
    let mut turns = Vec::new();
    for _ in 0..if peer.is_some() { REPEATS } else { 1 } {
        let own_rows = ours()?;
        let peer_rows = peer.as_ref().map_or(Ok(Vec::new()), |peer| (peer.measure)())?;
        turns.push((own_rows, peer_rows));
    }
    let value =
        |rows: &[Row], name: &str| rows.iter().find(|row| row.name == name).map(|row| row.value);
    let names: Vec<String> = turns[0].0.iter().map(|row| row.name.clone()).collect();
    let rows = names.into_iter().map(|name| {
        let baseline = peer.as_ref().map(|peer| format!("{}_{name}", peer.name));
        let baseline = baseline.and_then(|baseline| {
            let pairs = turns.iter().filter_map(|(own_rows, peer_rows)| {
                Some((value(own_rows, &name)?, value(peer_rows, &baseline)?))
            });
            let (ratios, values): (Vec<f64>, Vec<f64>) =
                pairs.map(|(own, theirs)| (own / theirs, theirs)).unzip();
            let min = ratios.iter().copied().reduce(f64::min)?;
            let max = ratios.iter().copied().reduce(f64::max)?;
            let (value, ratio) = (median(values), median(ratios));
            Some(Baseline { name: baseline, value, ratio, ratio_range: [min, max] })
        });
        let ours = turns.iter().filter_map(|(own_rows, _)| value(own_rows, &name)).collect();
        Row { name, value: median(ours), unit: "ms".into(), baseline }
    });
    Ok(rows.collect())
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

/// MuJoCo's time for the same control periods: same robot, table and box.
fn mujoco(workspace: &Workspace, state: &str) -> Result<Vec<Row>> {
    let python = python::environment(workspace, python::BASELINES)?;
    let urdf = "assets/robot/iiwa7_allegro/robot.urdf";
    let script = ["tests/python/mujoco_tick.py", urdf, state];
    let output = workspace::output_of(&mut workspace.command(python, &script))?;
    Ok(output.lines().filter_map(row).collect())
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
    fn ratio_to_a_baseline_is_the_median_over_turns() {
        let turn = std::cell::Cell::new(0.0);
        let ours = || {
            turn.set(turn.get() + 1.0);
            Ok(vec![row(&format!("row tick {} ms", 2.0 * turn.get())).unwrap()])
        };
        let theirs = || Ok(vec![row("row mujoco_tick 2 ms").unwrap()]);
        let rows = in_turns(ours, Some(Peer { name: "mujoco", measure: &theirs })).unwrap();
        let baseline = rows[0].baseline.as_ref().unwrap();
        assert_eq!((baseline.name.as_str(), baseline.value), ("mujoco_tick", 2.0));
        assert_eq!((baseline.ratio, baseline.ratio_range), (6.0, [1.0, 10.0]));
        assert_eq!(in_turns(ours, None).unwrap()[0].baseline, None);
    }

    #[test]
    fn rows_are_parsed_from_runner_output() {
        let found = row("    row tick_wasm 3.25 ms").unwrap();
        assert_eq!((found.name.as_str(), found.value), ("tick_wasm", 3.25));
        assert_eq!(row("test attempt::rows ... ok"), None);
        assert_eq!(row("row without a number"), None);
    }
}
