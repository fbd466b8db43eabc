//! `ngf replay`: a recorded episode through physics again.

use anyhow::{Context, Result, bail};
use dataset::generate::built_in_object;
use rollout::{Attempt, Controller, Episode, Verdict, Workcell};
use std::path::PathBuf;

/// What to replay, or to record.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Episode file.
    file: PathBuf,
    /// Record an attempt of the planner on this built-in object into the file first.
    #[arg(long, value_name = "NAME")]
    record: Option<String>,
    /// Seed of the recorded attempt.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Replays and prints verdict and final state hash; other ones than were recorded are an error.
pub(crate) fn run(options: &Options) -> Result<()> {
    let workcell = Workcell::new()?;
    if let Some(name) = &options.record {
        let object = built_in_object(name)?;
        let mut attempt =
            Attempt::begin(&workcell, &object, name, None, options.seed, Controller::Planner)?;
        attempt.run(&workcell);
        dataset::store::write(&options.file, &serde_json::to_vec(&attempt.episode())?)?;
    }
    let bytes = std::fs::read(&options.file)
        .with_context(|| format!("cannot read {}", options.file.display()))?;
    let episode: Episode = serde_json::from_slice(&bytes)
        .with_context(|| format!("{} is not an episode", options.file.display()))?;
    let object = built_in_object(&episode.name)?;
    let (verdict, hash) = episode.replay(&workcell, &object)?;
    println!("{}", words(verdict));
    println!("{hash}");
    if hash != episode.state_hash {
        bail!("the recording ended in {}", episode.state_hash);
    }
    if verdict != episode.verdict {
        bail!("the recording ended otherwise: {}", words(episode.verdict));
    }
    Ok(())
}

fn words(verdict: Option<Verdict>) -> &'static str {
    verdict.map_or("No verdict.", |verdict| verdict.words())
}
