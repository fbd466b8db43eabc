//! `ngf physics`: compares physics settings with a fine reference on the same attempts and trials.

use crate::datagen_bench::{Case, cases_of};
use crate::evaluate::{load_model, seeds};
use crate::train::parse_positive;
use anyhow::{Context, Result, bail};
use evaluation::percentiles::MedianP90;
use files::atomic_file;
use grasps::RobotContext;
use grasps::search::trial::{TrialOutcome, TrialProtocol, try_grasp};
use objects::object::Object;
use rayon::prelude::*;
use rollout::{Attempt, Controller, Outcome, RolloutContext};
use scene::SceneConfig;
use serde_json::Value;
use std::path::PathBuf;
use std::time::Instant;

/// Settings to compare, and the attempts that compare them.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Settings to compare with the scene's, e.g. `physics.substeps=2,motors.hand_armature=0.002`; repeatable
    #[arg(long, value_name = "KEY=VALUE,...")]
    set: Vec<String>,
    /// Objects, by name
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_value = "sugar_box,bleach")]
    object: Vec<String>,
    /// Model: name of a folder in models/, path of a folder, or `planner`
    #[arg(long, value_name = "NAME|DIR", default_value = "planner")]
    model: String,
    /// Attempts per object
    #[arg(long, default_value_t = 50, value_parser = parse_positive)]
    attempts: usize,
    /// Trials per object in which the arm shakes the object for 2 s; 0 for none
    #[arg(long, default_value_t = 20)]
    shaken: usize,
    /// Seed of the first attempt
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Write the rows to this JSON file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The reference: 128 substeps per control period, each with 8 + 8 sweeps over the constraints.
const REFERENCE: &str = "physics.substeps=8,physics.solver_iterations=16,physics.pgs_iterations=8,\
    physics.stabilization_iterations=8,physics.friction_in_bias_pass=true";

/// Results of one setting for one object.
#[derive(serde::Serialize)]
struct Row {
    setting: String,
    object: String,
    /// Mean time (ms) of a control period, controller included, with all threads working.
    tick_ms: f64,
    attempts: usize,
    lifted: usize,
    /// Attempts with the reference's verdict: lifted or not.
    same_verdict: usize,
    /// Slip (m) of the lifted objects.
    slip: Option<MedianP90>,
    shaken: usize,
    /// Shaken trials in which the object was held.
    held: usize,
    /// Slip (m) in these trials.
    shaken_slip: Option<MedianP90>,
}

/// Runs the reference, the settings of the scene and each given setting.
pub(crate) fn run(options: &Options) -> Result<()> {
    let mut context = RolloutContext::new()?;
    let controller = if options.model == "planner" {
        Controller::Planner
    } else {
        load_model(&mut context, &options.model)?;
        Controller::Policy
    };
    let standard = context.robot.config.clone();
    let mut settings = vec![("reference".to_owned(), REFERENCE), ("scene".to_owned(), "")];
    settings.extend(options.set.iter().map(|set| (set.clone(), set.as_str())));
    for (_, setting) in &settings {
        with_settings(&standard, setting)?;
    }
    let objects = options
        .object
        .iter()
        .map(|name| Ok((name.as_str(), objects::catalog::built_in_object(name)?)));
    let objects: Vec<(&str, Object)> = objects.collect::<Result<_>>()?;
    let mut rows: Vec<Row> = Vec::new();
    println!(
        "setting, object: ms per control period; lifted; verdict of the reference; slip; shaken"
    );
    for (name, object) in &objects {
        let mut reference = Vec::new();
        for (label, setting) in &settings {
            context.robot.config = with_settings(&standard, setting)?;
            let run = run_attempts(&context, options, name, object, &controller)?;
            if reference.is_empty() {
                reference.clone_from(&run.lifted);
            }
            let slips = match options.shaken {
                0 => Vec::new(),
                trials => shake(&context.robot, name, object, trials)?,
            };
            let row = Row {
                setting: label.clone(),
                object: (*name).to_owned(),
                tick_ms: run.tick_ms,
                attempts: options.attempts,
                lifted: run.lifted.iter().filter(|lifted| **lifted).count(),
                same_verdict: run.lifted.iter().zip(&reference).filter(|(a, b)| a == b).count(),
                slip: MedianP90::of(run.slips),
                shaken: options.shaken,
                held: slips.len(),
                shaken_slip: MedianP90::of(slips),
            };
            print_row(&row);
            rows.push(row);
        }
    }
    print_sums(&settings, &rows);
    match &options.json {
        Some(path) => atomic_file::write(path, &serde_json::to_vec_pretty(&rows)?),
        None => Ok(()),
    }
}

/// The configuration with the settings `section.key=value,...` changed.
fn with_settings(config: &SceneConfig, settings: &str) -> Result<SceneConfig> {
    let mut file = serde_json::to_value(config)?;
    for setting in settings.split(',').filter(|setting| !setting.is_empty()) {
        let (key, value) = setting.split_once('=').unwrap_or((setting, ""));
        let pointer = format!("/{}", key.trim().replace('.', "/"));
        let Some(entry) = file.pointer_mut(&pointer) else {
            bail!("scene.toml has no key {key}; write --set section.key=value");
        };
        *entry = serde_json::from_str(value).unwrap_or(Value::Null);
    }
    serde_json::from_value(file).with_context(|| format!("--set {settings} is not valid"))
}

/// Results of the attempts of one setting with one object.
struct Run {
    tick_ms: f64,
    lifted: Vec<bool>,
    slips: Vec<f64>,
}

fn run_attempts(
    context: &RolloutContext,
    options: &Options,
    name: &str,
    object: &Object,
    controller: &Controller,
) -> Result<Run> {
    let seeds = seeds(options.seed, options.attempts)?;
    let run = |seed| {
        let mut attempt = Attempt::new(context, object, name, None, seed, controller.clone())?;
        let start = Instant::now();
        let outcome = attempt.run(context);
        Ok((outcome, start.elapsed().as_secs_f64() * 1e3, attempt.ticks()))
    };
    let results: Vec<_> = seeds.into_par_iter().map(run).collect::<Result<_>>()?;
    let (time, ticks) = results.iter().fold((0.0, 0), |(t, n), (_, ms, ticks)| (t + ms, n + ticks));
    let slips = results.iter().filter_map(|(outcome, ..)| match outcome {
        Outcome::Lifted { slip } => Some(f64::from(*slip)),
        Outcome::Failed { .. } => None,
    });
    Ok(Run {
        tick_ms: time / ticks.max(1) as f64,
        lifted: results.iter().map(|(outcome, ..)| outcome.is_lifted()).collect(),
        slips: slips.collect(),
    })
}

/// Slips (m) of the trials in which a shaken object is held: grasps of the catalogue at random poses.
fn shake(robot: &RobotContext, name: &str, object: &Object, trials: usize) -> Result<Vec<f64>> {
    let cases = cases_of(robot, name, object, trials)?;
    let outcomes = cases.par_iter().map(|Case { placed, posture, lift }| {
        try_grasp(placed, posture, lift, TrialProtocol::FULL)
    });
    let outcomes: Vec<TrialOutcome> = outcomes.collect::<Result<_, _>>()?;
    let slips = outcomes.into_iter().filter_map(|outcome| match outcome {
        TrialOutcome::Lifted { slip } => Some(f64::from(slip)),
        TrialOutcome::Failed(_) | TrialOutcome::NotFinite => None,
    });
    Ok(slips.collect())
}

fn print_row(row: &Row) {
    let millimetres = |slip: &Option<MedianP90>| {
        slip.map_or("-".to_owned(), |s| format!("{:.1} / {:.1} mm", 1e3 * s.median, 1e3 * s.p90))
    };
    println!(
        "{}\n  {:16} {:6.3} ms  {:3} of {:3} lifted  {:3} same  slip {:>13}  held {:2} of {:2} shaken, {}",
        row.setting,
        row.object,
        row.tick_ms,
        row.lifted,
        row.attempts,
        row.same_verdict,
        millimetres(&row.slip),
        row.held,
        row.shaken,
        millimetres(&row.shaken_slip),
    );
}

/// Prints the sums over the objects for each setting.
fn print_sums(settings: &[(String, &str)], rows: &[Row]) {
    for (label, _) in settings {
        let of = || rows.iter().filter(|row| &row.setting == label);
        let sum = |value: fn(&Row) -> usize| of().map(value).sum::<usize>();
        println!(
            "{label}\n  all objects: {} of {} lifted, {} same verdicts, {} of {} held when shaken",
            sum(|row| row.lifted),
            sum(|row| row.attempts),
            sum(|row| row.same_verdict),
            sum(|row| row.held),
            sum(|row| row.shaken),
        );
    }
}
