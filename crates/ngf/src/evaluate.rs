//! `ngf evaluate`: attempts by the protocol, with controls, as a table and as JSON.

use crate::bar::Bar;
use crate::card;
use crate::objects::{ObjectOptions, Subject};
use crate::train::at_least_one;
use anyhow::{Context, Result, bail};
use dataset::store;
use geometry::catalog::{CATALOG, Entry, of_family};
use geometry::object::Object;
use imitation::evaluation::{self, Report};
use rollout::{Controller, Workcell};
use std::collections::BTreeSet;
use std::ops::Range;
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
    /// Every built-in object of these families instead of one object, with their sums.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    #[arg(conflicts_with_all = ["object", "mesh", "friction"])]
    family: Vec<String>,
    /// Attempts with each object.
    #[arg(long, default_value_t = 100, value_parser = at_least_one)]
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
    /// What the policy is told of the joints: what it commanded, as it was trained, or what is measured.
    #[arg(long, value_enum, default_value_t = Feedback::Commanded)]
    #[arg(conflicts_with = "card")]
    feedback: Feedback,
}

/// What a policy is told of the joints.
#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum Feedback {
    Commanded,
    Measured,
}

/// Evaluates and prints one line for each controller, and for families their sums.
pub(crate) fn run(options: &Options) -> Result<()> {
    let mut workcell = Workcell::new()?;
    let model_hash = match options.model.as_str() {
        "planner" => None,
        model => Some(load(&mut workcell, model)?),
    };
    if model_hash.is_none() && options.card.is_some() {
        bail!("--card is of a model, and the planner is none");
    }
    let objects = objects(options, &workcell)?;
    let pose = pose(options)?;
    let seeds = seeds(options.seed, options.attempts)?;
    let mut reports = Vec::new();
    for Subject { name, object, stands } in &objects {
        for (label, controller, object) in contestants(options, object) {
            let (bar, done) = (Bar::new(&label, options.attempts), AtomicUsize::new(0));
            let advance = |_: &rollout::Attempt| {
                bar.set(1 + done.fetch_add(1, Ordering::Relaxed));
                Ok(())
            };
            let seeds = seeds.clone();
            let mut report =
                evaluation::evaluate(&workcell, &object, name, &controller, pose, seeds, &advance)?;
            bar.clear();
            report.policy = label;
            report.model_hash.clone_from(&model_hash);
            report.stands = *stands;
            print(&report);
            reports.push(report);
        }
    }
    print_sums(options, &reports);
    if let Some(path) = &options.json {
        store::write(path, &serde_json::to_vec_pretty(&reports)?)?;
    }
    options.card.as_ref().map_or(Ok(()), |path| card::update(path, &reports))
}

/// The seeds of so many attempts.
pub(crate) fn seeds(first: u64, attempts: usize) -> Result<Range<u64>> {
    let most = u64::MAX - attempts as u64;
    if first > most {
        bail!("--seed may be at most {most} for {attempts} attempts");
    }
    Ok(first..first + attempts as u64)
}

/// Objects that are attempted; a mesh lies as the page has it with this model.
fn objects(options: &Options, mut workcell: &Workcell) -> Result<Vec<Subject>> {
    if options.family.is_empty() {
        return Ok(vec![options.object.load_as(&mut workcell)?]);
    }
    let families: BTreeSet<&str> = CATALOG.iter().map(|entry| entry.family).collect();
    if let Some(unknown) = options.family.iter().find(|name| !families.contains(name.as_str())) {
        let families: Vec<&str> = families.into_iter().collect();
        bail!("there is no family {unknown}; there are {}", families.join(", "));
    }
    // A family that is named twice is counted once.
    let asked: BTreeSet<&String> = options.family.iter().collect();
    let named = asked.into_iter().flat_map(|family| of_family(family));
    named.map(|entry: &Entry| Subject::built_in(entry.name)).collect()
}

/// Who acts on an object: name, controller, and the object as it is for it.
fn contestants(options: &Options, object: &Object) -> Vec<(String, Controller, Object)> {
    let (label, controller) = match options.model.as_str() {
        "planner" => ("planner", Controller::Planner),
        _ if options.feedback == Feedback::Measured => ("policy, measured", Controller::Measured),
        _ => ("policy", Controller::Policy),
    };
    let mut all = vec![(label.to_owned(), controller.clone(), object.clone())];
    if options.controls {
        if options.model != "planner" {
            let other = |label: &str, controller| (label.to_owned(), controller, object.clone());
            all.push(other("no policy", Controller::Script));
            all.push(other("shuffled z", Controller::ShuffledLatent));
            all.push(other("zero z", Controller::ZeroLatent));
        }
        let slippery = object.clone().with_friction(0.0);
        all.push((format!("{label}, friction 0"), controller, slippery));
    }
    all
}

/// Pose of the object for all attempts, if one is given.
fn pose(options: &Options) -> Result<Option<[f32; 3]>> {
    Ok(match options.pose.as_deref() {
        Some(&[x, y, yaw]) if [x, y, yaw].iter().all(|number| number.is_finite()) => {
            Some([x, y, yaw])
        }
        Some(&[_, _, _]) => bail!("--pose takes finite numbers"),
        Some(other) => bail!("--pose takes x,y,yaw, found {} numbers", other.len()),
        None => None,
    })
}

/// For each controller the sum of each family, and that of all of them, with the interval for objects like these.
fn print_sums(options: &Options, reports: &[Report]) {
    let labels: BTreeSet<&str> = reports.iter().map(|report| report.policy.as_str()).collect();
    let sum = |label: &str, of: &str, is_in: &dyn Fn(&str) -> bool| {
        let counted = reports.iter().filter(|r| r.policy == label && is_in(&r.object));
        let counts: Vec<_> = counted.map(|report| (report.lifted, report.attempts)).collect();
        let (lifted, attempts) = counts.iter().fold((0, 0), |(l, n), (k, m)| (l + k, n + m));
        let [low, high] = rollout::wilson95_among(&counts).map(|x| 100.0 * x);
        println!(
            "{label:18} {of:14} {lifted:3} of {attempts:3} lifted, \
             95 % interval among objects {low:.0}..{high:.0} %"
        );
    };
    for label in labels {
        for family in options.family.iter().collect::<BTreeSet<_>>() {
            let is_in = |name: &str| of_family(family).any(|entry| entry.name == name);
            sum(label, family, &is_in);
        }
        if options.family.len() > 1 {
            sum(label, "all", &|_| true);
        }
    }
}

pub(crate) fn print(report: &Report) {
    let [low, high] = report.wilson95.map(|x| 100.0 * x);
    let failures: Vec<String> =
        report.failures.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
    let off = report.off().map(|m| format!("; the encoder is off by {:.1} mm", 1000.0 * m));
    let like = report.most_like().map(|object| format!("; most like {object}"));
    println!(
        "{:18} {:14} {:3} of {:3} lifted, 95 % interval {low:.0}..{high:.0} %  {}{}",
        report.policy,
        report.object,
        report.lifted,
        report.attempts,
        failures.join(", "),
        like.unwrap_or_default() + &off.unwrap_or_default()
    );
}

/// Loads a model from models/NAME or from a folder; gives the hash of its files.
pub(crate) fn load(workcell: &mut Workcell, model: &str) -> Result<String> {
    let (named, folder) = (Path::new("models").join(model), Path::new(model));
    // `./NAME` is a folder.
    if model.contains(std::path::is_separator) || !named.is_dir() {
        return load_folder(workcell, folder);
    }
    if folder.join("config.json").exists() {
        bail!("{model} is a model here and in models/; say ./{model} or models/{model}");
    }
    load_folder(workcell, &named)
}

/// Loads the model of a folder; gives the hash of its files.
pub(crate) fn load_folder(workcell: &mut Workcell, folder: &Path) -> Result<String> {
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
