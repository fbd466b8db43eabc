//! `ngf train encoder|policy|start-net`: training with checkpoints, from which a killed run resumes.

mod encoder;
mod log;
mod policy;
mod settings;
mod start_net;
mod validation;

pub(crate) use policy::read_model;

use anyhow::{Result, bail};
use std::path::{Path, PathBuf};

/// Error text for a training stopped by its callback; the callbacks of this program never stop it.
const STOPPED: &str = "training was stopped before it finished";

/// Network to train.
#[derive(clap::Subcommand)]
pub(crate) enum Options {
    /// Train the autoencoder on the point clouds of a dataset
    Encoder(encoder::Options),
    /// Train a policy on the demonstrations of a dataset, with the encoder in the output folder
    Policy(policy::Options),
    /// Train a start network, which replaces the start table of a model
    StartNet(start_net::Options),
}

/// Options of every training.
#[derive(clap::Args)]
pub(crate) struct TrainArgs {
    /// Folder of the dataset
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Folder of checkpoints and results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Optimizer steps (default: set by the network)
    #[arg(long)]
    steps: Option<u64>,
    /// Threads
    #[arg(long, default_value_t = 2, value_parser = parse_positive)]
    threads: usize,
    /// Seed of weights and batches
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Batch size (default: set by the network)
    #[arg(long, value_parser = parse_positive)]
    batch: Option<usize>,
    /// Peak learning rate (default: set by the network)
    #[arg(long, value_parser = parse_learning_rate, allow_negative_numbers = true)]
    lr: Option<f32>,
    /// Steps between checkpoints (default: set by the network)
    #[arg(long, value_name = "STEPS", value_parser = parse_positive)]
    checkpoint_every: Option<usize>,
}

/// Parses a positive integer.
pub(crate) fn parse_positive(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("must be at least 1".into()),
        Ok(number) => Ok(number),
        Err(error) => Err(format!("{error}")),
    }
}

fn parse_fraction(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(fraction) if (0.0..=1.0).contains(&fraction) => Ok(fraction),
        Ok(_) => Err("must be between 0 and 1".into()),
        Err(error) => Err(format!("{error}")),
    }
}

fn parse_norm(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(norm) if norm > 0.0 && norm < f32::INFINITY => Ok(norm),
        Ok(_) => Err("must be positive and finite".into()),
        Err(error) => Err(format!("{error}")),
    }
}

fn parse_learning_rate(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(rate) if rate > 0.0 && rate < 1.0 => Ok(rate),
        Ok(_) => Err("must be between 0 and 1".into()),
        Err(error) => Err(format!("{error}")),
    }
}

/// Rejects an output folder equal to the input folder `from` of option `flag`. Otherwise a killed run would
/// have overwritten its inputs.
fn reject_same_folder(flag: &str, from: &Path, out: &Path) -> Result<()> {
    let canonical = |folder: &Path| folder.canonicalize().ok();
    if canonical(from).is_some() && canonical(from) == canonical(out) {
        bail!(
            "--out is the folder of {flag}, whose files would be overwritten; choose another folder"
        );
    }
    Ok(())
}

pub(crate) fn run(options: &Options) -> Result<()> {
    match options {
        Options::Encoder(run) => encoder::train(run),
        Options::Policy(options) => policy::train(options),
        Options::StartNet(options) => start_net::train(options),
    }
}
