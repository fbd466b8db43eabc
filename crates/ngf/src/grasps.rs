//! `ngf grasps`: searches grasps of one object.

use crate::bar::Bar;
use crate::objects::ObjectOptions;
use anyhow::{Context, Result};
use dataset::store;
use grasps::Robot;
use grasps::import::GraspFile;
use grasps::place::{REACH_POSES, poses_served};
use grasps::search::{SearchConfig, search, try_imported};
use std::path::PathBuf;

/// What to search for.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    object: ObjectOptions,
    /// File of grasps from elsewhere, which are closed and tried instead of a search.
    #[arg(long, value_name = "FILE")]
    import: Option<PathBuf>,
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

/// Searches grasps and writes them.
pub(crate) fn run(options: &Options) -> Result<()> {
    let robot = Robot::standard()?;
    let (name, object) = options.object.load()?;
    let bar = Bar::new(&format!("{name}: grasps"), 100);
    let config = SearchConfig::paper(&robot);
    let progress = |share| bar.set((share * 100.0) as usize);
    let (set, reliable) = match &options.import {
        None => search(&robot, &object, &config, options.seed, progress)?,
        Some(path) => {
            let bytes =
                std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            let file = GraspFile::parse(&bytes)?;
            let imported = file.read(&robot.tree, &object)?;
            try_imported(&robot, &object, &config, &imported, options.seed, progress)?
        }
    };
    bar.clear();
    println!(
        "{name}: {} proposals, {} closed, {} tried, {} lifted, {} reliable; with arm and hand {} of {} \
         lifted; {} grasps of {} kinds kept",
        set.proposed,
        set.closed,
        set.tried,
        set.lifted,
        set.reliable,
        set.confirmed[1],
        set.confirmed[0],
        set.grasps.len(),
        set.grasps.last().map_or(0, |last| last.kind + 1),
    );
    for (kind, poses) in poses_served(&robot, &object, &set.grasps).iter().enumerate() {
        println!("  kind {kind}: the first within reach at {poses} of {REACH_POSES} poses");
    }
    if let Some(path) = &options.reliable {
        store::write(path, &serde_json::to_vec_pretty(&reliable)?)?;
    }
    store::write(&options.out, &serde_json::to_vec_pretty(&set)?)
}
