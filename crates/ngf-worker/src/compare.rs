//! `ngf compare`: comparison of policies and controls. An interrupted run resumes from its cached reports.

use crate::evaluate::{load_model_folder, seeds};
use crate::object_selection::{self, MassSpec, SelectedObject};
use crate::train::{parse_positive, read_model};
use anyhow::{Context, Result, bail};
use dataset::Dataset;
use evaluation::EvaluationReport;
use evaluation::comparison::{self, AttemptTelemetry, Comparison};
use files::atomic_file;
use grasps::set::catalog::catalog_grasps;
use imitation::data::split;
use indicatif::ProgressBar;
use objects::import::{FIRST_POSE, ImportOptions, MASS_LIMITS};
use objects::object::Object;
use policy::PolicyConfig;
use policy::networks::{NetworkConfig, POLICY_NAMES};
use rollout::{Attempt, Controller, RolloutContext};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Policies, objects and attempts to compare.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder of models, one subfolder for each policy: ngf-pcd, ngf-pos, ...
    #[arg(long, value_name = "DIR")]
    models_dir: PathBuf,
    /// Objects: built-in names, or `FILE:KG` for a mesh file and its mass
    #[arg(long, value_name = "NAME|FILE:KG", value_delimiter = ',')]
    #[arg(default_values_t = ["sugar_box", "bleach", "mustard"].map(str::to_owned))]
    objects: Vec<String>,
    /// Attempts per policy and object
    #[arg(long, default_value_t = 300, value_parser = parse_positive)]
    attempts: usize,
    /// Seed of the first attempt; all policies use the same seeds
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Dataset folder, for the control that plays back its demonstrations
    #[arg(long, value_name = "DIR")]
    dataset: Option<PathBuf>,
    /// Output folder for comparison.{json,md,svg}, telemetry plots, and a recording of each failure
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// A policy or control, evaluated on all objects.
struct PolicyEntry {
    label: String,
    controller: Controller,
    friction: Option<f32>,
    model: PathBuf,
    /// Hash of the dataset whose demonstrations are played back.
    demonstrations: Option<String>,
}

/// Runs the missing evaluations and writes the comparison.
pub(crate) fn run(options: &Options) -> Result<()> {
    seeds(options.seed, options.attempts)?;
    let objects =
        options.objects.iter().map(|text| parse_object(text)).collect::<Result<Vec<_>>>()?;
    let mut names = BTreeSet::new();
    if let Some(SelectedObject { name, .. }) = objects.iter().find(|it| !names.insert(&it.name)) {
        bail!("two objects are named {name}; rename one of the files");
    }
    let contestants = policy_entries(&options.models_dir, options.dataset.as_deref())?;
    let policies =
        contestants.iter().filter(|entry| POLICY_NAMES.contains(&entry.label.as_str())).count();
    let program = std::env::current_exe().context("cannot locate this executable")?;
    let program = hash_parts(&[&std::fs::read(&program)?]);
    let mut found = Comparison::default();
    let mut context = RolloutContext::new()?;
    for entry in &contestants {
        let model_hash = load_model_folder(&mut context, &entry.model)?;
        for SelectedObject { name, object, orientation } in &objects {
            let controller_hash = match (&entry.controller, &entry.demonstrations) {
                (Controller::Planner, _) => {
                    // The planner has grasps for built-in objects only.
                    let Some(set) = catalog_grasps(name) else { continue };
                    hash_parts(&[&serde_json::to_vec(&set.grasps)?])
                }
                // The model selects the demonstration, so both hashes matter.
                (_, Some(demonstrations)) => {
                    hash_parts(&[demonstrations.as_bytes(), model_hash.as_bytes()])
                }
                _ => model_hash.clone(),
            };
            let cell = ComparisonCell {
                options,
                entry,
                name,
                input_hash: &controller_hash,
                program: &program,
            };
            let report = cell.report(&context, object)?;
            found.reports.push(EvaluationReport { orientation: *orientation, ..report });
        }
    }
    let json = serde_json::to_vec_pretty(&found)?;
    atomic_file::write(&options.out.join("comparison.json"), &json)?;
    let table = comparison::markdown_report(&found);
    atomic_file::write(&options.out.join("comparison.md"), table.as_bytes())?;
    atomic_file::write(
        &options.out.join("comparison.svg"),
        comparison::success_chart(&found, policies).as_bytes(),
    )?;
    print!("{table}");
    Ok(())
}

/// The policies found in `models`, then the controls, which use the first policy.
fn policy_entries(models: &Path, data: Option<&Path>) -> Result<Vec<PolicyEntry>> {
    let there: Vec<&str> =
        POLICY_NAMES.into_iter().filter(|name| models.join(name).is_dir()).collect();
    let Some(first) = there.first() else {
        bail!(
            "{} contains no model; expected subfolders: {}",
            models.display(),
            POLICY_NAMES.join(", ")
        )
    };
    for missing in POLICY_NAMES.iter().filter(|name| !there.contains(name)) {
        eprintln!("warning: {} has no {missing}", models.display());
    }
    for name in &there {
        let (_, model) = read_model(&models.join(name))?;
        if !matches_name(&model.policy, name) {
            bail!(
                "{} contains a policy of another type than its folder name",
                models.join(name).display()
            );
        }
    }
    let policy = |name: &&str| PolicyEntry {
        label: (*name).to_owned(),
        controller: Controller::Policy,
        friction: None,
        model: models.join(name),
        demonstrations: None,
    };
    let control = |label: &str, controller, friction| PolicyEntry {
        label: label.to_owned(),
        controller,
        friction,
        model: models.join(first),
        demonstrations: None,
    };
    let mut all: Vec<PolicyEntry> = there.iter().map(policy).collect();
    all.push(control("planner", Controller::Planner, None));
    if let Some(data) = data {
        let dataset = Dataset::open(data)?;
        let library = Arc::new(split::demonstration_library(&dataset)?);
        let play_back = control("play-back", Controller::Playback(library), None);
        all.push(PolicyEntry { demonstrations: Some(dataset.hash()?), ..play_back });
    }
    all.extend([
        control("no policy", Controller::ScriptedClose, None),
        control("shuffled z", Controller::ShuffledLatent, None),
        control("zero z", Controller::ZeroLatent, None),
        control("friction 0", Controller::Policy, Some(0.0)),
    ]);
    Ok(all)
}

fn hash_parts(parts: &[&[u8]]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(part);
    }
    hasher.finalize().to_hex().to_string()
}

/// Whether a policy has the network configuration of this policy name. The potential center is ignored,
/// because it comes from the training data.
fn matches_name(policy: &PolicyConfig, name: &str) -> bool {
    let Some(mut expected) = PolicyConfig::by_name(name) else { return false };
    if let (NetworkConfig::Ngf(expected), NetworkConfig::Ngf(found)) =
        (&mut expected.network, &policy.network)
    {
        expected.potential_center = found.potential_center;
    }
    expected == *policy
}

/// Loads a built-in object, or a mesh file with its mass.
fn parse_object(text: &str) -> Result<SelectedObject> {
    match text.rsplit_once(':') {
        None => SelectedObject::built_in(text),
        Some((file, mass)) => {
            let mass: f32 =
                mass.parse().with_context(|| format!("{text}: the mass (kg) is not a number"))?;
            let name = format!("{text}: the mass");
            let mass = object_selection::check_range(&name, mass, MASS_LIMITS, "kg")?;
            // No orientation chooser: every policy gets the same object.
            let options = ImportOptions::default();
            object_selection::import_mesh(
                Path::new(file),
                options,
                &MassSpec::Mass(mass),
                FIRST_POSE,
            )
        }
    }
}

/// Cached report with the hash of the program that produced it; another program may give other results.
#[derive(serde::Serialize, serde::Deserialize)]
struct CachedReport {
    #[serde(default)]
    program: String,
    #[serde(flatten)]
    report: EvaluationReport,
}

/// One policy on one object.
struct ComparisonCell<'a> {
    options: &'a Options,
    entry: &'a PolicyEntry,
    name: &'a str,
    input_hash: &'a str,
    program: &'a str,
}

impl ComparisonCell<'_> {
    /// Returns the cached report if its inputs are the same, otherwise a new report.
    fn report(&self, context: &RolloutContext, object: &Object) -> Result<EvaluationReport> {
        let Self { options, entry, name, input_hash: controller_hash, program } = self;
        let object = match entry.friction {
            Some(friction) => object.clone().with_friction(friction),
            None => object.clone(),
        };
        let label = format!("{}-{name}", entry.label.replace(' ', "-"));
        let path = options.out.join("reports").join(format!("{label}.json"));
        if let Ok(bytes) = std::fs::read(&path) {
            let CachedReport { program: of, report: cached } = serde_json::from_slice(&bytes)
                .with_context(|| format!("{} is damaged: delete it", path.display()))?;
            let is_same = of == *program
                && cached.object_hash == object.hash()
                && cached.scene_hash == scene::scene_hash()
                && cached.model_hash.as_deref() == Some(*controller_hash)
                && (cached.seed, cached.attempts) == (options.seed, options.attempts);
            if is_same {
                return Ok(cached);
            }
        }
        let bar = ProgressBar::new(options.attempts as u64);
        bar.set_message(label.clone());
        let failures = options.out.join("failures").join(&label);
        if failures.exists() {
            std::fs::remove_dir_all(&failures)
                .with_context(|| format!("cannot delete {}", failures.display()))?;
        }
        let courses = Mutex::new(BTreeMap::new());
        let observe = |attempt: &Attempt| {
            bar.inc(1);
            let is_lifted = attempt.outcome().is_some_and(|verdict| verdict.is_lifted());
            if let Ok(mut courses) = courses.lock() {
                courses.insert(attempt.seed(), (is_lifted, attempt.telemetry(context)));
            }
            if is_lifted {
                return Ok(());
            }
            let recording = attempt.recording();
            let file = failures.join(format!("{}.json", recording.seed));
            atomic_file::write(&file, &serde_json::to_vec(&recording)?)
        };
        let seeds = seeds(options.seed, options.attempts)?;
        let controller = &entry.controller;
        let found =
            evaluation::evaluate(context, &object, name, controller, None, seeds, &observe)?;
        bar.finish_and_clear();
        let courses: Vec<AttemptTelemetry> =
            courses.into_inner().unwrap_or_default().into_values().collect();
        let figure = comparison::telemetry_plots(&format!("{} on {name}", entry.label), &courses);
        let plot_path = options.out.join("telemetry").join(format!("{label}.svg"));
        atomic_file::write(&plot_path, figure.as_bytes())?;
        let report = EvaluationReport {
            policy: entry.label.clone(),
            model_hash: Some((*controller_hash).to_owned()),
            ..found
        };
        crate::evaluate::print_report(&report);
        let kept = CachedReport { program: (*program).to_owned(), report };
        atomic_file::write(&path, &serde_json::to_vec_pretty(&kept)?)?;
        Ok(kept.report)
    }
}
