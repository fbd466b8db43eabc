//! `ngf examine`: free roll-outs of a policy on the poses of a dataset, object by object: does it know what it was
//! taught, and what lies between?

use crate::train::read_model;
use ::policy::Network;
use ::policy::weights::Tensors;
use anyhow::Result;
use dataset::Dataset;
use imitation::encoder::TrainedEncoder;
use imitation::free_rollout::fingertip_errors;
use imitation::lesson::Lesson;
use imitation::split;
use imitation::spread::Spread;
use robot::Tree;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// What is examined.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder of the model.
    #[arg(long, value_name = "DIR")]
    model: PathBuf,
    /// Folder of the dataset.
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Lessons, object poses at a bearing, of each object and kind.
    #[arg(long, default_value_t = 20)]
    lessons: usize,
}

/// Prints a line for each object: how far off the fingertips end on poses that were taught, and on held-out ones.
pub(crate) fn run(options: &Options) -> Result<()> {
    let tree = Tree::iiwa7_allegro()?;
    let (weights, config) = read_model(&options.model)?;
    let network = Network::load(&Tensors::parse(&weights)?, &config.policy, &tree.limits)?;
    let encoder = TrainedEncoder::of_model(&weights)?;
    let data = Dataset::open(&options.data)?;
    let observation = config.policy.observation;
    let (taught, held_out) =
        split::lessons(&data, &encoder, observation, poses_taught(&options.model))?;
    println!("{:18} {:>18} {:>18}", "fingertips off, mm", "taught", "held out");
    let mut all = [Vec::new(), Vec::new()];
    for (object, name) in data.config.objects.iter().enumerate() {
        print!("{name:18}");
        for (lessons, all) in [&taught, &held_out].into_iter().zip(&mut all) {
            let of_it = |lesson: &&Lesson| lesson.pose / data.config.poses == object;
            let lessons: Vec<&Lesson> = lessons.iter().filter(of_it).collect();
            let every = lessons.len().div_ceil(options.lessons.max(1)).max(1);
            let lessons: Vec<&Lesson> = lessons.into_iter().step_by(every).collect();
            let errors = fingertip_errors(&tree, &network, &lessons);
            all.extend(&errors);
            print_spread(errors);
        }
        println!();
    }
    print!("{:18}", "all");
    all.into_iter().for_each(print_spread);
    println!();
    Ok(())
}

/// Poses of each object that a model was taught, as is told beside it; all where nothing is told.
fn poses_taught(model: &Path) -> usize {
    let told = std::fs::read(model.join("dagger.json")).ok();
    let told: Option<Value> = told.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let poses = told.and_then(|told| told["poses"].as_u64());
    poses.map_or(usize::MAX, |poses| poses as usize)
}

/// Median, 9 of 10, and how many there are.
fn print_spread(errors: Vec<f64>) {
    let count = errors.len();
    match Spread::of(errors) {
        Some(Spread { median, p90 }) => {
            print!(" {:6.1} {:6.1} ({count:3})", 1e3 * median, 1e3 * p90);
        }
        None => print!(" {:>19}", "none"),
    }
}
