//! `ngf grasps` and `ngf dataset`.

use anyhow::{Context, Result, bail};
use grasps::Robot;
use grasps::search::{self, SearchConfig};
use imitation::dataset::{Dataset, DatasetConfig, built_in};
use imitation::store;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::sync::Mutex;

/// What to search for.
#[derive(clap::Args)]
pub(crate) struct GraspOptions {
    /// Built-in object by name.
    #[arg(long, value_name = "NAME")]
    object: String,
    /// Seed of the search.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Where to write the grasps.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Where to write all reliable grasps with their repeats that lifted.
    #[arg(long, value_name = "FILE")]
    reliable: Option<PathBuf>,
}

/// What to make.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// tiny, small or shipped.
    #[arg(long)]
    preset: String,
    /// Folder of the dataset; a folder that is half done is completed.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seed of everything.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads; all by default.
    #[arg(long, default_value_t = 0)]
    threads: usize,
}

/// Searches grasps and writes them.
pub(crate) fn grasps(options: &GraspOptions) -> Result<()> {
    let robot = Robot::standard()?;
    let object = built_in(&options.object)?;
    let bar = bar(100);
    let config = SearchConfig::paper(&robot);
    let (set, reliable) = search::search(&robot, &object, &config, options.seed, |share| {
        bar.set_position((share * 100.0) as u64);
    })?;
    bar.finish_and_clear();
    println!(
        "{}: {} proposals, {} closed, {} tried, {} lifted, {} reliable, {} kept",
        options.object,
        set.proposed,
        set.closed,
        set.tried,
        set.lifted,
        set.reliable,
        set.grasps.len()
    );
    let served = search::poses_served(&robot, &object, &set.grasps);
    for (kind, poses) in served.iter().enumerate() {
        println!(
            "  kind {kind}: the first within reach at {poses} of {} poses",
            search::REACH_POSES
        );
    }
    if let Some(path) = &options.reliable {
        store::write(path, &serde_json::to_vec_pretty(&reliable)?)?;
    }
    store::write(&options.out, &serde_json::to_vec_pretty(&set)?)
}

/// Makes or completes a dataset.
pub(crate) fn run(options: &Options) -> Result<()> {
    let Some(config) = DatasetConfig::preset(&options.preset, options.seed) else {
        bail!("there is no preset {}; known are tiny, small and shipped", options.preset);
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build_global()
        .context("cannot start the threads; try fewer with --threads")?;
    let robot = Robot::standard()?;
    let dataset = Dataset::create(&options.out, config)?;
    let shown = Mutex::new((String::new(), bar(0)));
    dataset.generate(&robot, &|stage, done, total| {
        if let Ok(mut shown) = shown.lock() {
            if shown.0 != stage {
                *shown = (stage.to_owned(), bar(total as u64));
                shown.1.set_message(stage.to_owned());
            }
            shown.1.set_position(done as u64);
        }
    })?;
    let mut counts = std::collections::BTreeMap::new();
    for name in &dataset.config.objects {
        for index in 0..dataset.config.poses {
            for (what, count) in dataset.pose(name, index)?.counts {
                *counts.entry(format!("{name}: {what}")).or_insert(0) += count;
            }
        }
    }
    println!("{}", serde_json::to_string_pretty(&counts)?);
    Ok(())
}

fn bar(total: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:28} {bar:32} {pos}/{len} {per_sec} {eta} left");
    ProgressBar::new(total).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
