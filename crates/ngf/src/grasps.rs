//! `ngf grasps`: searches grasps of one object.

use crate::bar::Bar;
use crate::objects::ObjectOptions;
use anyhow::Result;
use dataset::store;
use grasps::Robot;
use grasps::place::{REACH_POSES, poses_served};
use grasps::search::{SearchConfig, search};
use std::path::PathBuf;

/// What to search for.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    object: ObjectOptions,
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
    let (set, reliable) =
        search(&robot, &object, &config, options.seed, |share| bar.set((share * 100.0) as usize))?;
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
