//! `ngf evaluate`: attempts by the protocol, with controls, as a table and as JSON.

use crate::bar::Bar;
use crate::card;
use crate::objects::ObjectOptions;
use anyhow::{Context, Result, bail};
use dataset::store;
use imitation::evaluation::{self, Report};
use rollout::{Controller, Workcell};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// What to evaluate.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Model by name (a folder of models/) or by folder; `planner` needs none.
    #[arg(long, value_name = "NAME|DIR")]
    model: String,
    #[command(flatten)]
    object: ObjectOptions,
    /// Attempts.
    #[arg(long, default_value_t = 100)]
    attempts: usize,
    /// Seed of the first attempt.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Pose of the object for all attempts instead of a drawn one: x, y (m) and yaw (rad).
    #[arg(long, value_name = "X,Y,YAW", value_delimiter = ',', allow_hyphen_values = true)]
    pose: Option<Vec<f32>>,
    /// Where to write the report.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Card of the model to put the counts into; it holds attempts by the protocol.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pose", "friction"])]
    card: Option<PathBuf>,
    /// Evaluate the controls too.
    #[arg(long)]
    controls: bool,
}

/// Evaluates and prints one line for each controller.
pub(crate) fn run(options: &Options) -> Result<()> {
    let (name, object) = options.object.load()?;
    let mut workcell = Workcell::new()?;
    let mut runs = Vec::new();
    let mut model_hash = None;
    if options.model == "planner" {
        runs.push((Controller::Planner, object.clone(), "planner".to_owned()));
    } else {
        model_hash = Some(load(&mut workcell, &options.model)?);
        runs.push((Controller::Policy, object.clone(), "policy".to_owned()));
    }
    if options.controls {
        let slippery = object.clone().with_friction(0.0);
        if options.model != "planner" {
            runs.push((Controller::Script, object.clone(), "no policy".to_owned()));
            runs.push((Controller::ShuffledLatent, object.clone(), "shuffled z".to_owned()));
            runs.push((Controller::ZeroLatent, object.clone(), "zero z".to_owned()));
        }
        let label = format!("{}, friction 0", runs[0].2);
        runs.push((runs[0].0.clone(), slippery, label));
    }
    let pose = match options.pose.as_deref() {
        Some(&[x, y, yaw]) if [x, y, yaw].iter().all(|number| number.is_finite()) => {
            Some([x, y, yaw])
        }
        Some(&[_, _, _]) => bail!("--pose takes finite numbers"),
        Some(other) => bail!("--pose takes x,y,yaw, found {} numbers", other.len()),
        None => None,
    };
    let most = u64::MAX - options.attempts as u64;
    if options.seed > most {
        bail!("--seed may be at most {most} for {} attempts", options.attempts);
    }
    let mut reports = Vec::new();
    for (controller, object, label) in runs {
        let (bar, done) = (Bar::new(&label, options.attempts), AtomicUsize::new(0));
        let seeds = options.seed..options.seed + options.attempts as u64;
        let advance = |_: &rollout::Attempt| {
            bar.set(1 + done.fetch_add(1, Ordering::Relaxed));
            Ok(())
        };
        let mut report =
            evaluation::evaluate(&workcell, &object, &name, &controller, pose, seeds, &advance)?;
        bar.clear();
        report.policy = label;
        report.model_hash.clone_from(&model_hash);
        print(&report);
        reports.push(report);
    }
    if let Some(path) = &options.json {
        store::write(path, &serde_json::to_vec_pretty(&reports)?)?;
    }
    options.card.as_ref().map_or(Ok(()), |path| card::update(path, &reports))
}

pub(crate) fn print(report: &Report) {
    let [low, high] = report.wilson95.map(|x| 100.0 * x);
    let failures: Vec<String> =
        report.failures.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
    let unlike =
        report.unlikeness().map(|m| format!("; the encoder is off by {:.1} mm", 1000.0 * m));
    println!(
        "{:18} {:14} {:3} of {:3} lifted, 95 % interval {low:.0}..{high:.0} %  {}{}",
        report.policy,
        report.object,
        report.lifted,
        report.attempts,
        failures.join(", "),
        unlike.unwrap_or_default()
    );
}

/// Loads a model from models/NAME or from a folder; gives the hash of its files.
pub(crate) fn load(workcell: &mut Workcell, model: &str) -> Result<String> {
    let named = Path::new("models").join(model);
    let folder = if named.is_dir() { named } else { PathBuf::from(model) };
    let read = |file: &str| {
        let path = folder.join(file);
        std::fs::read(&path).with_context(|| {
            format!(
                "{} cannot be read; --model names a folder of models/ or any folder",
                path.display()
            )
        })
    };
    let [weights, starts, config] =
        [read("weights.safetensors")?, read("starts.safetensors")?, read("config.json")?];
    Ok(workcell.load_model(&weights, &starts, &config)?)
}
