//! A start network in place of the table of starts of a model.

use super::log::Log;
use super::policy::read_file;
use super::{Run, STOPPED, refuse_same};
use anyhow::{Context, Result};
use dataset::Dataset;
use dataset::generate::built_in_object;
use dataset::store;
use grasps::Robot;
use imitation::encoder::TrainedEncoder;
use imitation::start::{self, StartConfig, errors, queries};
use policy::model::ModelConfig;
use policy::{Starts, WeightsError};
use std::path::PathBuf;

/// What only the start network knows.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    run: Run,
    /// Folder of the model whose starts are learned; it is written anew, with the network for the table, to the other
    /// folder.
    #[arg(long, value_name = "DIR")]
    from: PathBuf,
}

/// Trains it and writes the model.
pub(super) fn train(options: &Options) -> Result<()> {
    let run = &options.run;
    refuse_same(&options.from, &run.out)?;
    let standard = StartConfig::standard();
    let config = StartConfig {
        steps: run.steps.unwrap_or(standard.steps),
        batch: run.batch.unwrap_or(standard.batch),
        rate: run.rate.unwrap_or(standard.rate),
        span: run.checkpoint.map_or(standard.span, |steps| steps as u64),
        threads: run.threads,
        seed: run.seed,
        ..standard
    };
    let read = |file| read_file(&options.from, file);
    let (weights, about) = (read("weights.safetensors")?, read("config.json")?);
    let robot = Robot::standard()?;
    let observation = ModelConfig::parse(&about)?.policy.observation;
    let load = |bytes: &[u8]| -> Result<Starts, WeightsError> {
        Starts::load(bytes, observation.size(), &robot.tree)
    };
    let Starts::Table(table) = load(&read("starts.safetensors")?)? else {
        anyhow::bail!(
            "{} has no table of starts to learn from; give the model that it was made of",
            options.from.display()
        );
    };
    let dataset = Dataset::open(&run.data)?;
    let encoder = TrainedEncoder::of_model(&weights)?;
    let known = |name: &str| built_in_object(name).ok();
    let [taught, held_out] = queries(&dataset, &encoder, observation, &table, &robot, known)?;
    println!("{} queries to learn from; {} held out", taught.len(), held_out.len());
    let mut log = Log::open(&run.out, "start", "loss (rad)", config.batch)?;
    let trained = start::train(&taught, &robot.tree, &config, &run.out, &mut log)?;
    let params = trained.context(STOPPED)?;
    let bytes = params.export(&[])?;
    let starts = load(&bytes).context("what was trained")?;
    for (label, queries) in [("taught", &taught), ("held out", &held_out)] {
        let [joints, palm] = errors(&starts, &robot.tree, queries);
        println!("{label}: {joints:.2} rad, palm {:.0} mm from the look-up (median)", 1e3 * palm);
    }
    store::write(&run.out.join("weights.safetensors"), &weights)?;
    store::write(&run.out.join("starts.safetensors"), &bytes)?;
    store::write(&run.out.join("config.json"), &about)
}
