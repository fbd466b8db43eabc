//! `ngf train encoder`, `ngf train policy` and `ngf train start`: training with checkpoints; a killed run continues.

mod encoder;
mod exam;
mod log;
mod policy;
mod start;

pub(crate) use policy::read_model;

use anyhow::{Result, bail};
use std::path::{Path, PathBuf};

/// A training's watcher may end it, though none does here.
const STOPPED: &str = "it was stopped on the way";

/// What to train.
#[derive(clap::Subcommand)]
pub(crate) enum Options {
    /// The autoencoder, on a dataset's clouds.
    Encoder(Run),
    /// The policy, on a dataset's demonstrations, with the encoder in the same folder.
    Policy(policy::Options),
    /// A start network, which takes the place of a model's table of starts.
    Start(start::Options),
}

/// Where from, where to, how long.
#[derive(clap::Args)]
pub(crate) struct Run {
    /// Folder of the dataset.
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder of checkpoints and results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Optimiser steps instead of the standard number.
    #[arg(long)]
    steps: Option<u64>,
    /// Threads.
    #[arg(long, default_value_t = 2, value_parser = at_least_one)]
    threads: usize,
    /// Seed of weights and batches.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Batch size instead of the standard one.
    #[arg(long, value_parser = at_least_one)]
    batch: Option<usize>,
    /// Peak learning rate instead of the standard one.
    #[arg(long, value_parser = rate, allow_negative_numbers = true)]
    rate: Option<f32>,
    /// Steps from checkpoint to checkpoint instead of the standard number.
    #[arg(long, value_name = "STEPS", value_parser = at_least_one)]
    checkpoint: Option<usize>,
}

/// A number of things, which is not zero.
pub(crate) fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("it must be at least 1".into()),
        Ok(number) => Ok(number),
        Err(error) => Err(format!("{error}")),
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        Ok(_) => Err("it must be between 0 and 1".into()),
        Err(error) => Err(format!("{error}")),
    }
}

fn norm(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(norm) if norm > 0.0 && norm < f32::INFINITY => Ok(norm),
        Ok(_) => Err("it must be more than 0, and finite".into()),
        Err(error) => Err(format!("{error}")),
    }
}

fn rate(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(rate) if rate > 0.0 && rate < 1.0 => Ok(rate),
        Ok(_) => Err("it must be between 0 and 1".into()),
        Err(error) => Err(format!("{error}")),
    }
}

/// Refuses to write where is read from: whoever is killed on the way could not go on.
fn refuse_same(from: &Path, out: &Path) -> Result<()> {
    let whole = |folder: &Path| folder.canonicalize().ok();
    if whole(from).is_some() && whole(from) == whole(out) {
        bail!("--out is the folder of --from, whose files would be lost; choose another one");
    }
    Ok(())
}

pub(crate) fn run(options: &Options) -> Result<()> {
    match options {
        Options::Encoder(run) => encoder::train(run),
        Options::Policy(options) => policy::train(options),
        Options::Start(options) => start::train(options),
    }
}
