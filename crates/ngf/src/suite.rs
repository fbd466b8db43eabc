//! `ngf suite`: the paper's comparison in one command; a run that was stopped goes on.

use crate::evaluate::{load_folder, seeds};
use crate::objects::{self, Heaviness, Subject};
use crate::train::{at_least_one, read_model};
use anyhow::{Context, Result, bail};
use dataset::Dataset;
use dataset::store;
use geometry::object::Object;
use grasps::built_in::built_in;
use imitation::evaluation::{self, Report};
use imitation::split;
use imitation::suite::{self, Course, Suite};
use indicatif::ProgressBar;
use policy::PolicyConfig;
use policy::network::{NetworkConfig, POLICIES};
use rollout::{Attempt, Controller, Workcell};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// What is compared.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder with a model in a folder each, named as the policies: ngf-pcd, ngf-pos, ...
    #[arg(long, value_name = "DIR")]
    models: PathBuf,
    /// Objects: names of built-in ones, or `FILE:KG` for a mesh and its mass.
    #[arg(long, value_name = "NAME|FILE:KG", value_delimiter = ',')]
    #[arg(default_values_t = ["sugar_box", "bleach", "mustard"].map(str::to_owned))]
    objects: Vec<String>,
    /// Attempts of each policy on each object.
    #[arg(long, default_value_t = 300, value_parser = at_least_one)]
    attempts: usize,
    /// Seed of the first attempt, the same for all.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder of the dataset, for the control that plays its demonstrations back.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Where to write suite.json, suite.md, suite.svg, the courses of the attempts, and an episode of every failure.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// One who acts on all objects.
struct Contestant {
    label: String,
    controller: Controller,
    friction: Option<f32>,
    model: PathBuf,
    /// Hash of what else it acts by: the demonstrations that are played back.
    demonstrations: Option<String>,
}

/// Runs what is missing and writes the report.
pub(crate) fn run(options: &Options) -> Result<()> {
    seeds(options.seed, options.attempts)?;
    let objects = options.objects.iter().map(|text| object(text)).collect::<Result<Vec<_>>>()?;
    let mut names = BTreeSet::new();
    if let Some(Subject { name, .. }) = objects.iter().find(|it| !names.insert(&it.name)) {
        bail!("two objects are named {name}: rename the file of one");
    }
    let contestants = contestants(&options.models, options.data.as_deref())?;
    let policies = contestants.iter().filter(|who| POLICIES.contains(&who.label.as_str())).count();
    let program = std::env::current_exe().context("where this program is")?;
    let program = hash_of(&[&std::fs::read(&program)?]);
    let mut found = Suite::default();
    let mut workcell = Workcell::new()?;
    for who in &contestants {
        let model_hash = load_folder(&mut workcell, &who.model)?;
        for Subject { name, object, stands } in &objects {
            let acts_by = match (&who.controller, &who.demonstrations) {
                (Controller::Planner, _) => {
                    // It knows the grasps of built-in objects only.
                    let Some(set) = built_in(name) else { continue };
                    hash_of(&[&serde_json::to_vec(&set.grasps)?])
                }
                // The model says which one is played back.
                (_, Some(demonstrations)) => {
                    hash_of(&[demonstrations.as_bytes(), model_hash.as_bytes()])
                }
                _ => model_hash.clone(),
            };
            let cell = Cell { options, who, name, acts_by: &acts_by, program: &program };
            let report = cell.report(&workcell, object)?;
            found.reports.push(Report { stands: *stands, ..report });
        }
    }
    let json = serde_json::to_vec_pretty(&found)?;
    store::write(&options.out.join("suite.json"), &json)?;
    let table = suite::table(&found);
    store::write(&options.out.join("suite.md"), table.as_bytes())?;
    store::write(&options.out.join("suite.svg"), suite::figure(&found, policies).as_bytes())?;
    print!("{table}");
    Ok(())
}

/// The policies that are there, then the controls with the first of them.
fn contestants(models: &Path, data: Option<&Path>) -> Result<Vec<Contestant>> {
    let there: Vec<&str> = POLICIES.into_iter().filter(|name| models.join(name).is_dir()).collect();
    let Some(first) = there.first() else {
        bail!(
            "{} holds no model; folders in it are named {}",
            models.display(),
            POLICIES.join(", ")
        )
    };
    for missing in POLICIES.iter().filter(|name| !there.contains(name)) {
        eprintln!("warning: {} has no {missing}", models.display());
    }
    for name in &there {
        let (_, model) = read_model(&models.join(name))?;
        if !is_named(&model.policy, name) {
            bail!("{} holds another policy than its name says", models.join(name).display());
        }
    }
    let policy = |name: &&str| Contestant {
        label: (*name).to_owned(),
        controller: Controller::Policy,
        friction: None,
        model: models.join(name),
        demonstrations: None,
    };
    let control = |label: &str, controller, friction| Contestant {
        label: label.to_owned(),
        controller,
        friction,
        model: models.join(first),
        demonstrations: None,
    };
    let mut all: Vec<Contestant> = there.iter().map(policy).collect();
    all.push(control("planner", Controller::Planner, None));
    if let Some(data) = data {
        let dataset = Dataset::open(data)?;
        let library = Arc::new(split::library(&dataset)?);
        let play_back = control("play-back", Controller::Nearest(library), None);
        all.push(Contestant { demonstrations: Some(dataset.hash()?), ..play_back });
    }
    all.extend([
        control("no policy", Controller::Script, None),
        control("shuffled z", Controller::ShuffledLatent, None),
        control("zero z", Controller::ZeroLatent, None),
        control("friction 0", Controller::Policy, Some(0.0)),
    ]);
    Ok(all)
}

fn hash_of(parts: &[&[u8]]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(part);
    }
    hasher.finalize().to_hex().to_string()
}

/// Whether a policy has the sizes and scales of the one that is named so; where its bowl rests comes from the data.
fn is_named(policy: &PolicyConfig, name: &str) -> bool {
    let Some(mut wanted) = PolicyConfig::named(name) else { return false };
    if let (NetworkConfig::Ngf(wanted), NetworkConfig::Ngf(found)) =
        (&mut wanted.network, &policy.network)
    {
        wanted.rest = found.rest;
    }
    wanted == *policy
}

/// A built-in object, or a mesh with its mass.
fn object(text: &str) -> Result<Subject> {
    match text.rsplit_once(':') {
        None => Subject::built_in(text),
        Some((file, mass)) => {
            let mass: f32 =
                mass.parse().with_context(|| format!("{text}: the mass (kg) is no number"))?;
            let mass = objects::positive(&format!("{text}: the mass"), mass, "kilograms")?;
            // Every policy is given the same object.
            objects::of_mesh(Path::new(file), &Heaviness::Mass(mass), &mut ())
        }
    }
}

/// A report, and the hash of the program that made it: another one may try otherwise.
#[derive(serde::Serialize, serde::Deserialize)]
struct Kept {
    #[serde(default)]
    program: String,
    #[serde(flatten)]
    report: Report,
}

/// One policy on one object.
struct Cell<'a> {
    options: &'a Options,
    who: &'a Contestant,
    name: &'a str,
    acts_by: &'a str,
    program: &'a str,
}

impl Cell<'_> {
    /// The report that is there, if it is of the same things, or a new one.
    fn report(&self, workcell: &Workcell, object: &Object) -> Result<Report> {
        let Self { options, who, name, acts_by, program } = self;
        let object = match who.friction {
            Some(friction) => object.clone().with_friction(friction),
            None => object.clone(),
        };
        let words = format!("{}-{name}", who.label.replace(' ', "-"));
        let path = options.out.join("cells").join(format!("{words}.json"));
        if let Ok(bytes) = std::fs::read(&path) {
            let Kept { program: of, report: known } = serde_json::from_slice(&bytes)
                .with_context(|| format!("{} is damaged: delete it", path.display()))?;
            let is_same = of == *program
                && known.object_hash == object.hash()
                && known.scene_hash == scene::config::scene_hash()
                && known.model_hash.as_deref() == Some(*acts_by)
                && (known.seed, known.attempts) == (options.seed, options.attempts);
            if is_same {
                return Ok(known);
            }
        }
        let bar = ProgressBar::new(options.attempts as u64);
        bar.set_message(words.clone());
        let failures = options.out.join("failures").join(&words);
        if failures.exists() {
            std::fs::remove_dir_all(&failures)
                .with_context(|| format!("cannot remove {}", failures.display()))?;
        }
        let courses = Mutex::new(BTreeMap::new());
        let observe = |attempt: &Attempt| {
            bar.inc(1);
            let is_lifted = attempt.verdict().is_some_and(|verdict| verdict.is_lifted());
            if let Ok(mut courses) = courses.lock() {
                courses.insert(attempt.seed(), (is_lifted, attempt.course(workcell)));
            }
            if is_lifted {
                return Ok(());
            }
            let episode = attempt.episode();
            let file = failures.join(format!("{}.json", episode.seed));
            store::write(&file, &serde_json::to_vec(&episode)?)
        };
        let seeds = seeds(options.seed, options.attempts)?;
        let controller = &who.controller;
        let found =
            evaluation::evaluate(workcell, &object, name, controller, None, seeds, &observe)?;
        bar.finish_and_clear();
        let courses: Vec<Course> = courses.into_inner().unwrap_or_default().into_values().collect();
        let figure = suite::courses(&format!("{} on {name}", who.label), &courses);
        let place = options.out.join("courses").join(format!("{words}.svg"));
        store::write(&place, figure.as_bytes())?;
        let report =
            Report { policy: who.label.clone(), model_hash: Some((*acts_by).to_owned()), ..found };
        crate::evaluate::print(&report);
        let kept = Kept { program: (*program).to_owned(), report };
        store::write(&path, &serde_json::to_vec_pretty(&kept)?)?;
        Ok(kept.report)
    }
}
