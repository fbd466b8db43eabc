//! Training of a start network, which replaces the start table of a model.

use super::log::TrainingLog;
use super::policy::read_file;
use super::{STOPPED, TrainArgs, reject_same_folder};
use anyhow::{Context, Result};
use configs::StartConfig;
use dataset::Dataset;
use files::atomic_file;
use grasps::RobotContext;
use imitation::models::encoder::TrainedEncoder;
use imitation::train::start_net::{self, examples, median_errors};
use objects::catalog::built_in_object;
use policy::model::{CONFIG_FILE, ModelConfig, STARTS_FILE, WEIGHTS_FILE};
use policy::{StartModel, WeightsError};
use std::path::PathBuf;

/// Options of `ngf train start-net`.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    run: TrainArgs,
    /// Folder of the model whose start table is learned. The output folder receives a copy of this model,
    /// with the network instead of the table
    #[arg(long, value_name = "DIR")]
    model: PathBuf,
}

/// Trains the start network and writes the model.
pub(super) fn train(options: &Options) -> Result<()> {
    let run = &options.run;
    reject_same_folder("--model", &options.model, &run.out)?;
    let standard = StartConfig::standard();
    let config = StartConfig {
        steps: run.steps.unwrap_or(standard.steps),
        batch: run.batch.unwrap_or(standard.batch),
        learning_rate: run.lr.unwrap_or(standard.learning_rate),
        checkpoint_every: run
            .checkpoint_every
            .map_or(standard.checkpoint_every, |steps| steps as u64),
        threads: run.threads,
        seed: run.seed,
        ..standard
    };
    let read = |file| read_file(&options.model, file);
    let (weights, config_json) = (read(WEIGHTS_FILE)?, read(CONFIG_FILE)?);
    let robot = RobotContext::standard()?;
    let observation = ModelConfig::parse(&config_json)?.policy.observation;
    let load = |bytes: &[u8]| -> Result<StartModel, WeightsError> {
        StartModel::load(bytes, observation.num_features(), &robot.tree)
    };
    let StartModel::Table(table) = load(&read(STARTS_FILE)?)? else {
        anyhow::bail!(
            "{} has no start table to learn from; use the model that it was trained from",
            options.model.display()
        );
    };
    let dataset = Dataset::open(&run.dataset)?;
    let encoder = TrainedEncoder::from_model(&weights)?;
    let load_object = |name: &str| built_in_object(name).ok();
    let [train, held_out] = examples(&dataset, &encoder, observation, &table, &robot, load_object)?;
    println!("{} training examples; {} held out", train.len(), held_out.len());
    let mut log = TrainingLog::open(&run.out, "start", "loss (rad)", config.batch)?;
    let trained = start_net::train(&train, &robot.tree, &config, &run.out, &mut log)?;
    let params = trained.context(STOPPED)?;
    let bytes = params.export(&[])?;
    let starts = load(&bytes).context("cannot load the trained network")?;
    for (label, queries) in [("train", &train), ("held out", &held_out)] {
        let [joints, palm] = median_errors(&starts, &robot.tree, queries);
        println!(
            "{label}: median error {joints:.2} rad, palm {:.0} mm, compared with the start table",
            1e3 * palm
        );
    }
    atomic_file::write(&run.out.join(WEIGHTS_FILE), &weights)?;
    atomic_file::write(&run.out.join(STARTS_FILE), &bytes)?;
    atomic_file::write(&run.out.join(CONFIG_FILE), &config_json)
}
