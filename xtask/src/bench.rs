//! `bench`: what an attempt costs, natively and in the browser, as one table.

use crate::chromium;
use crate::place::{self, Place};
use crate::{python, tools};
use anyhow::{Context, Result};
use std::path::Path;

/// One measurement, beside that of a peer where there is one.
#[derive(Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Row {
    name: String,
    value: f64,
    unit: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    peer: Option<Peer>,
}

/// What another program needs for the same.
#[derive(Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Peer {
    name: String,
    value: f64,
    /// How many times the peer's value ours is.
    ratio: f64,
}

/// Measures, prints, and writes the rows to `json` if that is given; `peers` are measured too where there are
/// any.
pub(crate) fn run(place: &Place, json: Option<&Path>, peers: bool) -> Result<()> {
    let mut rows = native(place)?;
    if peers {
        let mujoco = mujoco(place)?;
        for row in rows.iter_mut().filter(|row| row.name == "physics_step_home") {
            let (name, value) = (mujoco.name.clone(), mujoco.value);
            row.peer = Some(Peer { name, value, ratio: row.value / value });
        }
    }
    rows.extend(in_browser(place)?);
    for row in &rows {
        print!("{:32} {:8.3} {:3}", row.name, row.value, row.unit);
        match &row.peer {
            Some(Peer { name, value, ratio }) => println!(" {name} {value:.3}: {ratio:.1} times"),
            None => println!(),
        }
    }
    if let Some(file) = json {
        std::fs::write(file, serde_json::to_vec_pretty(&rows)?)
            .with_context(|| format!("cannot write {}", file.display()))?;
    }
    Ok(())
}

/// The rows of `ngf bench`.
fn native(place: &Place) -> Result<Vec<Row>> {
    place::run(&mut place.cargo(&["build", "-q", "-p", "ngf"]))?;
    let file = place.target.join("bench.json");
    let mut bench = place.command(place.program("ngf"), &["bench", "--quiet", "--json"]);
    place::run(bench.arg(&file))?;
    Ok(serde_json::from_slice(&std::fs::read(&file)?)?)
}

/// A physics step of MuJoCo with the same robot, table and box.
fn mujoco(place: &Place) -> Result<Row> {
    let python = python::environment(place, "peers.txt")?;
    let script = ["tests/python/mujoco_step.py", "assets/robot/iiwa7_allegro.urdf"];
    let said = place::read(&mut place.command(python, &script))?;
    said.lines().find_map(row).context("mujoco_step.py printed no row")
}

/// The rows that `wasm/benches/attempt.rs` prints, built as the page's worker is.
fn in_browser(place: &Place) -> Result<Vec<Row>> {
    let chromium = chromium::find(place)?;
    tools::wasm_target(place)?;
    place::run(&mut place.cargo(&["build", "-q", "-p", "wasm-test-runner"]))?;
    let target = ["--target", "wasm32-unknown-unknown", "--profile", "wasm"];
    // The runner of browser tests knows neither `--bench` nor `--quiet`, which `cargo bench` passes on.
    let mut cargo = place.cargo(&["test", "-p", "wasm", "--bench", "attempt"]);
    let said = place::read(
        cargo
            .args(target)
            .args(["--", "--nocapture"])
            .env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUNNER", place.program("wasm-test-runner"))
            .env("CHROMEDRIVER", chromium.driver)
            .env("WASM_BINDGEN_TEST_TIMEOUT", "300"),
    )?;
    Ok(said.lines().filter_map(row).collect())
}

/// `row NAME VALUE UNIT`, with whatever the runner puts before it.
fn row(line: &str) -> Option<Row> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let at = words.iter().position(|word| *word == "row")?;
    let [name, value, unit] = words.get(at + 1..)? else { return None };
    let value = value.parse().ok()?;
    Some(Row { name: (*name).to_owned(), value, unit: (*unit).to_owned(), peer: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_among_what_a_runner_prints() {
        let found = row("    row tick_wasm 3.25 ms").unwrap();
        assert_eq!((found.name.as_str(), found.value), ("tick_wasm", 3.25));
        assert_eq!(row("test attempt::rows ... ok"), None);
        assert_eq!(row("row without a number"), None);
    }
}
