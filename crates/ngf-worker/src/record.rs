//! `ngf record`: records an attempt of the planner and checks that its recording replays.

use crate::replay::replay_file;
use anyhow::Result;
use objects::catalog::built_in_object;
use rollout::{Attempt, Controller, RolloutContext};
use std::path::PathBuf;

/// Object, seed and output of the recording.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Name of a built-in object
    #[arg(long, value_name = "NAME")]
    object: String,
    /// Seed of the attempt
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Output file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Runs an attempt of the planner, writes its recording, replays it, and prints outcome and final state hash.
pub(crate) fn run(options: &Options) -> Result<()> {
    let context = RolloutContext::new()?;
    let (name, planner) = (&options.object, Controller::Planner);
    let object = built_in_object(name)?;
    let mut attempt = Attempt::new(&context, &object, name, None, options.seed, planner)?;
    attempt.run(&context);
    files::atomic_file::write(&options.out, &serde_json::to_vec(&attempt.recording())?)?;
    replay_file(&context, &options.out, Some(object))
}
