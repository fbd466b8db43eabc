//! `ngf validate`: rollouts of a policy on the training and held-out poses of a dataset, without physics,
//! with fingertip errors by object, and the antisymmetric share of the policy's Jacobian.

use crate::train::read_model;
use ::policy::Network;
use ::policy::weights::Tensors;
use anyhow::Result;
use dataset::Dataset;
use evaluation::percentiles::MedianP90;
use imitation::data::demo_group::DemoGroup;
use imitation::data::split;
use imitation::models::encoder::TrainedEncoder;
use imitation::validate::jacobian_symmetry::antisymmetric_shares;
use imitation::validate::kinematic_rollout::fingertip_errors;
use robot::KinematicTree;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Model and dataset to validate.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder of the model
    #[arg(long, value_name = "DIR")]
    model: PathBuf,
    /// Folder of the dataset
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Demonstration groups (one grasp at one object pose and azimuth) per object and split
    #[arg(long, default_value_t = 20)]
    samples: usize,
}

/// Prints one line per object: fingertip errors on training poses and on held-out poses.
pub(crate) fn run(options: &Options) -> Result<()> {
    let tree = KinematicTree::iiwa7_allegro()?;
    let (weights, config) = read_model(&options.model)?;
    let network = Network::load(&Tensors::parse(&weights)?, &config.policy, &tree)?;
    let encoder = TrainedEncoder::from_model(&weights)?;
    let data = Dataset::open(&options.dataset)?;
    let observation = config.policy.observation;
    let (train, held_out) = split::train_val_split(
        std::slice::from_ref(&data),
        &encoder,
        observation,
        max_training_poses(&options.model),
    )?;
    println!("{:18} {:>18} {:>18}", "fingertip error, mm", "train", "held out");
    let mut all = [Vec::new(), Vec::new()];
    for (object, name) in data.config.objects.iter().enumerate() {
        print!("{name:18}");
        for (groups, all) in [&train, &held_out].into_iter().zip(&mut all) {
            let is_of_object = |group: &&DemoGroup| group.pose / data.config.poses == object;
            let groups: Vec<&DemoGroup> = groups.iter().filter(is_of_object).collect();
            let every = groups.len().div_ceil(options.samples.max(1)).max(1);
            let groups: Vec<&DemoGroup> = groups.into_iter().step_by(every).collect();
            let errors = fingertip_errors(&tree, &network, &groups);
            all.extend(&errors);
            print_percentiles(errors);
        }
        println!();
    }
    print!("{:18}", "all");
    all.into_iter().for_each(print_percentiles);
    println!();
    let every = held_out.len().div_ceil(MAX_JACOBIAN_GROUPS).max(1);
    let sample: Vec<&DemoGroup> = held_out.iter().step_by(every).collect();
    let shares = antisymmetric_shares(&network, &sample);
    if let Some(MedianP90 { median, p90 }) = MedianP90::of(shares) {
        println!("antisymmetric share of dq̈/dq, held out: {median:.3} (median), {p90:.3} (p90)");
    }
    Ok(())
}

/// Number of demonstration groups at which Jacobians are computed.
const MAX_JACOBIAN_GROUPS: usize = 100;

/// Training poses per object according to `training.json` of the model; unlimited if not recorded.
fn max_training_poses(model: &Path) -> usize {
    let record = std::fs::read(model.join("training.json")).ok();
    let record: Option<Value> = record.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let poses = record.and_then(|record| record["max_poses"].as_u64());
    poses.map_or(usize::MAX, |poses| poses as usize)
}

/// Prints median and p90 (mm), and the number of values.
fn print_percentiles(errors: Vec<f64>) {
    let count = errors.len();
    match MedianP90::of(errors) {
        Some(MedianP90 { median, p90 }) => {
            print!(" {:6.1} {:6.1} ({count:3})", 1e3 * median, 1e3 * p90);
        }
        None => print!(" {:>19}", "none"),
    }
}
