//! Training of the autoencoder, and its validation.

use super::log::TrainingLog;
use super::{STOPPED, TrainArgs, settings};
use anyhow::{Result, bail};
use configs::AutoencoderConfig;
use dataset::Dataset;
use files::atomic_file;
use grasps::RobotContext;
use imitation::models::encoder::TrainedEncoder;
use imitation::train::autoencoder;
use imitation::validate::linear_probe::linear_probe;
use imitation::validate::reconstruction::reconstruction_figure;
use objects::catalog::built_in_object;
use objects::object::Object;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Options of `ngf train encoder`.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    run: TrainArgs,
    /// Set a hyperparameter, by its name in `configs::AutoencoderConfig`; repeatable. For example grasp_weight=0.5
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Trains and validates the autoencoder.
pub(super) fn train(options: &Options) -> Result<()> {
    let run = &options.run;
    let mut config =
        AutoencoderConfig { threads: run.threads, seed: run.seed, ..AutoencoderConfig::standard() };
    config.steps = run.steps.unwrap_or(config.steps);
    config.batch = run.batch.unwrap_or(config.batch);
    config.learning_rate = run.lr.unwrap_or(config.learning_rate);
    config.checkpoint_every =
        run.checkpoint_every.map_or(config.checkpoint_every, |steps| steps as u64);
    let config = settings::apply(&config, &options.set)?;
    let dataset = Dataset::open(&run.dataset)?;
    let mut log = TrainingLog::open(&run.out, "encoder", "chamfer", config.batch)?;
    if !autoencoder::train(&dataset, &config, &run.out, &mut log)? {
        bail!(STOPPED);
    }
    validate(&run.out, &dataset.config.encoder_objects)
}

/// Views per object for the linear probe of the pose.
const PROBE_VIEWS: usize = 1000;

/// Max. number of training objects that are drawn and probed, evenly spaced.
const MAX_PROBED_OBJECTS: usize = 60;

/// Draws reconstructed clouds, and measures how well a linear probe of z predicts the pose of each training
/// object and of a held-out object.
fn validate(out: &Path, names: &[String]) -> Result<()> {
    let (encoder, robot) = (TrainedEncoder::load(out)?, RobotContext::standard()?);
    let mut report = serde_json::Map::new();
    let is_variant = |name: &&str| name.contains('.');
    let train: Vec<&str> =
        names.iter().map(String::as_str).filter(|name| !is_variant(name)).collect();
    let train = train.iter().copied().step_by(train.len().div_ceil(MAX_PROBED_OBJECTS).max(1));
    let held_out = ["mustard"].into_iter().filter(|name| !names.iter().any(|train| train == name));
    // User meshes are not available here.
    let load_object = |name| Some((name, built_in_object(name).ok()?));
    let objects: Vec<(&str, Object)> = train.chain(held_out).filter_map(load_object).collect();
    let picture =
        reconstruction_figure(&encoder, &robot, &objects, &mut ChaCha8Rng::seed_from_u64(1))?;
    atomic_file::write(&out.join("encoder.svg"), picture.as_bytes())?;
    for (name, object) in objects {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let found = linear_probe(&encoder, &robot, &object, PROBE_VIEWS, &mut rng)?;
        let [median, p90] = found.position.map(|x| 1e3 * x);
        print!("{name}: position error {median:.1} mm (median), {p90:.1} mm (p90)");
        match found.yaw.map(|yaw| yaw.map(f64::to_degrees)) {
            Some([median, p90]) => println!("; yaw error {median:.1} and {p90:.1} degrees"),
            None => println!("; rotationally symmetric"),
        }
        report.insert(name.to_owned(), serde_json::to_value(found)?);
    }
    atomic_file::write(&out.join("encoder.probe.json"), &serde_json::to_vec_pretty(&report)?)
}
