//! `ngf evaluate`: grasp attempts of a policy and of controls, as a table and as JSON.

use crate::model_card;
use crate::object_selection::{ObjectOptions, SelectedObject};
use crate::planner_grasps;
use crate::progress_bar::Bar;
use crate::train::parse_positive;
use anyhow::{Context, Result, bail};
use evaluation::EvaluationReport;
use files::atomic_file;
use objects::catalog::{family_names, objects_of_family};
use objects::object::Object;
use objects::shape_class::ShapeClass;
use policy::model::{CONFIG_FILE, STARTS_FILE, WEIGHTS_FILE};
use rollout::{Controller, RolloutContext};
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Model, objects and attempts to evaluate.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Model: name of a folder in models/, path of a folder, or `planner`
    #[arg(long, value_name = "NAME|DIR")]
    model: String,
    #[command(flatten)]
    object: ObjectOptions,
    /// Evaluate every object of these families, built-in or generated, instead of one object; with sums over families
    /// and shape classes
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    #[arg(conflicts_with_all = ["object", "mesh", "friction"])]
    family: Vec<String>,
    /// Grasps of the planner, as written by `ngf grasps`. Without a file: the grasps of the built-in object, or
    /// of a search for a mesh
    #[arg(long, value_name = "FILE", conflicts_with = "family")]
    grasps: Option<PathBuf>,
    /// Attempts per object
    #[arg(long, default_value_t = 100, value_parser = parse_positive)]
    attempts: usize,
    /// Seed of the first attempt, and of a grasp search
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Fixed object pose for all attempts: x, y (m) and yaw (rad)
    #[arg(long, value_name = "X,Y,YAW", value_delimiter = ',', allow_hyphen_values = true)]
    pose: Option<Vec<f32>>,
    /// Write the reports as JSON to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Model card to update with the results; requires protocol conditions (no --pose, no --friction)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pose", "friction"])]
    card: Option<PathBuf>,
    /// Also evaluate the controls
    #[arg(long)]
    controls: bool,
    /// Joint state observed by the policy: its own commands, as in training, or measurements
    #[arg(long, value_enum, default_value_t = Feedback::Commanded)]
    #[arg(conflicts_with = "card")]
    feedback: Feedback,
}

/// Joint state observed by the policy.
#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum Feedback {
    /// Commanded joint state, as in training
    Commanded,
    /// Measured joint state
    Measured,
}

/// Evaluates, prints one line per controller and object, and the sums by family.
pub(crate) fn run(options: &Options) -> Result<()> {
    let mut context = RolloutContext::new()?;
    let model_hash = match options.model.as_str() {
        "planner" => None,
        model => Some(load_model(&mut context, model)?),
    };
    if model_hash.is_none() && options.card.is_some() {
        bail!("--card needs a model; the planner has no card");
    }
    if model_hash.is_some() && options.grasps.is_some() {
        bail!("--grasps needs `--model planner`; a policy uses no grasps");
    }
    let objects = select_objects(options, &context)?;
    let pose = parse_pose(options)?;
    let seeds = seeds(options.seed, options.attempts)?;
    let mut reports = Vec::new();
    for selected in &objects {
        let SelectedObject { name, object, orientation } = selected;
        let main = match options.model.as_str() {
            "planner" => {
                let file = options.grasps.as_deref();
                planner_grasps::planner(&context.robot, selected, file, options.seed)?
            }
            _ if options.feedback == Feedback::Measured => Controller::PolicyMeasured,
            _ => Controller::Policy,
        };
        for (label, controller, object) in controllers(options, main, object) {
            let (bar, done) = (Bar::new(&label, options.attempts), AtomicUsize::new(0));
            let advance = |_: &rollout::Attempt| {
                bar.set(1 + done.fetch_add(1, Ordering::Relaxed));
                Ok(())
            };
            let seeds = seeds.clone();
            let mut report =
                evaluation::evaluate(&context, &object, name, &controller, pose, seeds, &advance)?;
            bar.clear();
            report.policy = label;
            report.model_hash.clone_from(&model_hash);
            report.orientation = *orientation;
            print_report(&report);
            reports.push(report);
        }
    }
    print_sums(options, &objects, &reports);
    if let Some(path) = &options.json {
        atomic_file::write(path, &serde_json::to_vec_pretty(&reports)?)?;
    }
    options.card.as_ref().map_or(Ok(()), |path| model_card::update(path, &reports))
}

/// Seeds of `attempts` attempts from `first` on.
pub(crate) fn seeds(first: u64, attempts: usize) -> Result<Range<u64>> {
    let max = u64::MAX - attempts as u64;
    if first > max {
        bail!("--seed must not exceed {max} for {attempts} attempts");
    }
    Ok(first..first + attempts as u64)
}

/// Selected objects. The model of `context` chooses the stable pose of a mesh, as on the page.
fn select_objects(options: &Options, context: &RolloutContext) -> Result<Vec<SelectedObject>> {
    if options.family.is_empty() {
        return Ok(vec![options.object.load_with(&|poses| context.most_familiar(poses))?]);
    }
    let families = family_names();
    if let Some(unknown) = options.family.iter().find(|name| !families.contains(&name.as_str())) {
        bail!("no family named {unknown}; known families: {}", families.join(", "));
    }
    // Duplicate family names count once.
    let requested: BTreeSet<&String> = options.family.iter().collect();
    let names = requested.into_iter().flat_map(|family| objects_of_family(family));
    names.map(|name| SelectedObject::built_in(&name)).collect()
}

/// The controller and its controls on an object: label, controller, and the object with its friction.
fn controllers(
    options: &Options,
    controller: Controller,
    object: &Object,
) -> Vec<(String, Controller, Object)> {
    let label = match controller {
        Controller::Planner | Controller::PlannedGrasps(_) => "planner",
        Controller::PolicyMeasured => "policy, measured",
        _ => "policy",
    };
    let mut all = vec![(label.to_owned(), controller.clone(), object.clone())];
    if options.controls {
        if options.model != "planner" {
            let other = |label: &str, controller| (label.to_owned(), controller, object.clone());
            all.push(other("no policy", Controller::ScriptedClose));
            all.push(other("shuffled z", Controller::ShuffledLatent));
            all.push(other("zero z", Controller::ZeroLatent));
        }
        let slippery = object.clone().with_friction(0.0);
        all.push((format!("{label}, friction 0"), controller, slippery));
    }
    all
}

/// Fixed object pose for all attempts, if given.
fn parse_pose(options: &Options) -> Result<Option<[f32; 3]>> {
    Ok(match options.pose.as_deref() {
        Some(&[x, y, yaw]) if [x, y, yaw].iter().all(|number| number.is_finite()) => {
            Some([x, y, yaw])
        }
        Some(&[_, _, _]) => bail!("--pose needs finite numbers"),
        Some(other) => bail!("--pose needs x,y,yaw, found {} numbers", other.len()),
        None => None,
    })
}

/// Prints the sums of each family and each shape class for each controller, and the sum of all families. The interval
/// is clustered by object.
fn print_sums(options: &Options, objects: &[SelectedObject], reports: &[EvaluationReport]) {
    let labels: BTreeSet<&str> = reports.iter().map(|report| report.policy.as_str()).collect();
    let sum = |label: &str, of: &str, is_in: &dyn Fn(&str) -> bool| {
        let counted = reports.iter().filter(|r| r.policy == label && is_in(&r.object));
        let counts: Vec<_> = counted.map(|report| (report.lifted, report.attempts)).collect();
        let (lifted, attempts) = counts.iter().fold((0, 0), |(l, n), (k, m)| (l + k, n + m));
        let [low, high] = rollout::clustered_wilson95(&counts).map(|x| 100.0 * x);
        println!(
            "{label:18} {of:14} {lifted:3} of {attempts:3} lifted, \
             95 % interval clustered by object {low:.0}..{high:.0} %"
        );
    };
    for label in labels {
        for family in options.family.iter().collect::<BTreeSet<_>>() {
            let names = objects_of_family(family);
            sum(label, family, &|name| names.iter().any(|other| other == name));
        }
        if options.family.len() > 1 {
            for class in ShapeClass::ALL {
                let members: Vec<&str> = objects
                    .iter()
                    .filter(|selected| class.contains(&selected.object))
                    .map(|selected| selected.name.as_str())
                    .collect();
                if !members.is_empty() {
                    sum(label, class.name(), &|name| members.contains(&name));
                }
            }
            sum(label, "all", &|_| true);
        }
    }
}

pub(crate) fn print_report(report: &EvaluationReport) {
    let [low, high] = report.wilson95.map(|x| 100.0 * x);
    let failures: Vec<String> =
        report.failures.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
    let error = report
        .median_reconstruction_error()
        .map(|m| format!("; reconstruction error {:.1} mm", 1000.0 * m));
    let nearest = report.nearest_object().map(|object| format!("; nearest object {object}"));
    println!(
        "{:18} {:14} {:3} of {:3} lifted, 95 % interval {low:.0}..{high:.0} %  {}{}",
        report.policy,
        report.object,
        report.lifted,
        report.attempts,
        failures.join(", "),
        nearest.unwrap_or_default() + &error.unwrap_or_default()
    );
}

/// Loads a model from models/NAME or from a folder; returns the hash of its files.
pub(crate) fn load_model(context: &mut RolloutContext, model: &str) -> Result<String> {
    let (bundled, folder) = (Path::new("models").join(model), Path::new(model));
    // `./NAME` always means a folder.
    if model.contains(std::path::is_separator) || !bundled.is_dir() {
        return load_model_folder(context, folder);
    }
    if folder.join(CONFIG_FILE).exists() {
        bail!("{model} exists both here and in models/; use ./{model} or models/{model}");
    }
    load_model_folder(context, &bundled)
}

/// Loads the model in a folder; returns the hash of its files.
pub(crate) fn load_model_folder(context: &mut RolloutContext, folder: &Path) -> Result<String> {
    let read = |file: &str| {
        let path = folder.join(file);
        std::fs::read(&path).with_context(|| {
            format!(
                "cannot read {}; --model needs the name of a folder in models/ or the path of a folder",
                path.display()
            )
        })
    };
    let [weights, starts, config] = [read(WEIGHTS_FILE)?, read(STARTS_FILE)?, read(CONFIG_FILE)?];
    Ok(context.load_model(&weights, &starts, &config)?)
}
