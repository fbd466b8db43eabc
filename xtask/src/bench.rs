//! `bench`: what attempts, training and the page take, natively and in the browser, as one table.

use crate::chromium;
use crate::place::{self, Place};
use crate::{demo, python, tools};
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
    /// How many times the peer's value ours is: the median, where they were measured in turns.
    ratio: f64,
    /// Least and greatest ratio of a turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    spread: Option<[f64; 2]>,
}

/// What a row may be at most, or has to be at least; on a machine of two cores that does nothing else.
enum Budget {
    Most(f64),
    Least(f64),
}

/// Of the page, as somebody before it waits for it. Its clock never runs ahead, and counts whole ticks: real time is a
/// little less than 1.
const BUDGETS: [(&str, Budget); 6] = [
    ("page_first_pixels", Budget::Most(1500.0)),
    ("page_second_picture", Budget::Most(500.0)),
    ("page_code", Budget::Most(1.0)),
    ("page_real_time_factor", Budget::Least(0.98)),
    ("page_interaction_p95", Budget::Most(100.0)),
    ("page_upload_to_verdict", Budget::Most(10_000.0)),
];

/// Turns in which our steps of training and those of the peer are measured one after the other.
const TURNS: usize = 10;

/// Measures, prints, and writes the rows to `json` if that is given; `peers` are measured too where there are
/// any. Gives whether all budgets are kept.
pub(crate) fn run(place: &Place, json: Option<&Path>, peers: bool) -> Result<bool> {
    place::run(&mut place.cargo(&["build", "-q", "-p", "ngf"]))?;
    let mut rows = native(place, &[])?;
    rows.extend(learning(place, peers)?);
    if peers {
        let mujoco = mujoco(place)?;
        for row in rows.iter_mut().filter(|row| row.name == "physics_step_home") {
            let (name, value) = (mujoco.name.clone(), mujoco.value);
            row.peer = Some(Peer { name, value, ratio: row.value / value, spread: None });
        }
    }
    rows.extend(in_browser(place)?);
    rows.extend(page(place)?);
    for row in &rows {
        print!("{:32} {:8.3} {:3}", row.name, row.value, row.unit);
        match &row.peer {
            Some(Peer { name, value, ratio, spread }) => {
                let spread = spread.map_or(String::new(), |[a, b]| format!(" ({a:.2} to {b:.2})"));
                println!(" {name} {value:.3}: {ratio:.2} times{spread}");
            }
            None => println!(),
        }
    }
    if let Some(file) = json {
        std::fs::write(file, serde_json::to_vec_pretty(&rows)?)
            .with_context(|| format!("cannot write {}", file.display()))?;
    }
    let over: Vec<String> = BUDGETS.iter().filter_map(|budget| excess(&rows, budget)).collect();
    over.iter().for_each(|words| println!("{words}"));
    Ok(over.is_empty())
}

/// What is to be said if a budget is not kept, or nothing was measured for it.
fn excess(rows: &[Row], (name, budget): &(&str, Budget)) -> Option<String> {
    let Some(Row { value, unit, .. }) = rows.iter().find(|row| row.name == *name) else {
        return Some(format!("{name} was not measured"));
    };
    let (is_kept, bound) = match budget {
        Budget::Most(most) => (value <= most, format!("{most} at most")),
        Budget::Least(least) => (value >= least, format!("{least} at least")),
    };
    (!is_kept).then(|| format!("{name} is {value:.3} {unit}: {bound}"))
}

/// The rows of `ngf bench`.
fn native(place: &Place, more: &[&str]) -> Result<Vec<Row>> {
    let file = place.target.join("bench.json");
    let mut bench = place.command(place.program("ngf"), &["bench", "--quiet", "--json"]);
    place::run(bench.arg(&file).args(more))?;
    Ok(serde_json::from_slice(&std::fs::read(&file)?)?)
}

/// Steps of training, in turns with those of PyTorch.
fn learning(place: &Place, peers: bool) -> Result<Vec<Row>> {
    let mut turns = Vec::new();
    for _ in 0..if peers { TURNS } else { 1 } {
        let ours = native(place, &["--learning"])?;
        turns.push((ours, if peers { torch(place)? } else { Vec::new() }));
    }
    let names: Vec<String> = turns[0].0.iter().map(|row| row.name.clone()).collect();
    let value =
        |rows: &[Row], name: &str| rows.iter().find(|row| row.name == name).map(|row| row.value);
    Ok(names
        .into_iter()
        .map(|name| {
            let ours = turns.iter().filter_map(|(ours, _)| value(ours, &name)).collect();
            let peer = format!("torch_{name}");
            let theirs: Vec<f64> =
                turns.iter().filter_map(|(_, theirs)| value(theirs, &peer)).collect();
            let ratios = turns
                .iter()
                .filter_map(|(ours, theirs)| Some(value(ours, &name)? / value(theirs, &peer)?));
            let mut ratios: Vec<f64> = ratios.collect();
            ratios.sort_by(f64::total_cmp);
            let peer = (!theirs.is_empty()).then(|| Peer {
                name: peer,
                value: median(theirs),
                spread: Some([ratios[0], ratios[ratios.len() - 1]]),
                ratio: median(ratios),
            });
            Row { name, value: median(ours), unit: "ms".into(), peer }
        })
        .collect())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The same steps in PyTorch, at its best number of threads.
fn torch(place: &Place) -> Result<Vec<Row>> {
    let python = python::environment(place, "peers.txt")?;
    let said = place::read(&mut place.command(python, &["tests/python/training_step.py"]))?;
    Ok(said.lines().filter_map(row).collect())
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

/// The rows that `tests/browser/figures.js` prints, of the page as it is served.
fn page(place: &Place) -> Result<Vec<Row>> {
    demo::build(place)?;
    let said = place::read(&mut tools::browser(place, "figures")?)?;
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
    fn what_is_out_of_its_budget_or_missing_is_told() {
        let said = |line: &str, budget| excess(&[row(line).unwrap()], &("page_code", budget));
        assert_eq!(said("row page_code 0.98 MB", Budget::Most(1.0)), None);
        let over = said("row page_code 1.02 MB", Budget::Most(1.0)).unwrap();
        assert_eq!(over, "page_code is 1.020 MB: 1 at most");
        assert!(said("row page_code 0.9 MB", Budget::Least(1.0)).unwrap().ends_with("at least"));
        assert!(said("row page_code NaN MB", Budget::Most(1.0)).is_some());
        let missing = said("row page_size 0.98 MB", Budget::Most(1.0));
        assert_eq!(missing.unwrap(), "page_code was not measured");
    }

    #[test]
    fn rows_are_found_among_what_a_runner_prints() {
        let found = row("    row tick_wasm 3.25 ms").unwrap();
        assert_eq!((found.name.as_str(), found.value), ("tick_wasm", 3.25));
        assert_eq!(row("test attempt::rows ... ok"), None);
        assert_eq!(row("row without a number"), None);
    }
}
