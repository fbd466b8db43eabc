//! Training/validation split of a dataset.

use crate::data::demo_group::{self, DemoGroup};
use crate::models::encoder::TrainedEncoder;
use crate::nn::networks::autoencoder as net;
use crate::train::expert::DemoTrajectories;
use anyhow::Result;
use dataset::Dataset;
use policy::{Observation, ObservationKind};
use rayon::prelude::*;
use rollout::DemonstrationLibrary;
use std::sync::Arc;

/// Whether the object pose with this index is held out: every tenth one, from index 9.
pub fn is_held_out(index: usize) -> bool {
    index % 10 == 9
}

/// Demonstration groups of several datasets: the training set, and the held-out set from all held-out poses.
///
/// The training set contains the first `max_poses` poses of each object, without the held-out poses. Poses are counted
/// over the objects of all datasets.
pub fn train_val_split(
    datasets: &[Dataset],
    encoder: &TrainedEncoder,
    observation: ObservationKind,
    max_poses: usize,
) -> Result<(Vec<DemoGroup>, Vec<DemoGroup>)> {
    let (mut objects, mut first_pose) = (Vec::new(), 0);
    for dataset in datasets {
        for object in 0..dataset.config.objects.len() {
            objects.push((dataset, object, first_pose));
            first_pose += dataset.config.poses;
        }
    }
    let split = |(dataset, object, first_pose)| {
        split_object(dataset, encoder, observation, max_poses, object, first_pose)
    };
    let by_object = objects.into_par_iter().map(split).collect::<Result<Vec<_>>>()?;
    let (train, held_out): (Vec<_>, Vec<_>) = by_object.into_iter().unzip();
    let [mut train, mut held_out] =
        [train, held_out].map(|groups| groups.into_iter().flatten().collect::<Vec<DemoGroup>>());
    let starts = demo_group::collect_starts(&train);
    demo_group::link_neighbor_starts(&mut train, &starts);
    demo_group::link_neighbor_starts(&mut held_out, &starts);
    Ok((train, held_out))
}

/// Training and held-out groups of one object, by its index in the dataset. `first_pose`: index of its first pose.
fn split_object(
    dataset: &Dataset,
    encoder: &TrainedEncoder,
    observation: ObservationKind,
    max_poses: usize,
    object: usize,
    first_pose: usize,
) -> Result<(Vec<DemoGroup>, Vec<DemoGroup>)> {
    let name: Arc<str> = dataset.config.objects[object].as_str().into();
    let (mut train, mut held_out) = (Vec::new(), Vec::new());
    for (index, record) in dataset.read_poses(object)?.into_iter().enumerate() {
        let is_skipped = index >= max_poses && !is_held_out(index);
        if is_skipped || record.offsets.len() < 2 {
            continue;
        }
        let encodings = encoder.observe(observation, &record.clouds)?;
        let grasps = DemoTrajectories::new(record.states, record.offsets).group_by_final_posture();
        let per_turn =
            encodings.chunks_exact((encodings.len() / record.azimuths.len().max(1)).max(1));
        for (turn, encodings) in record.azimuths.iter().zip(per_turn) {
            let groups = if is_held_out(index) { &mut held_out } else { &mut train };
            groups.extend(grasps.iter().map(|grasp| DemoGroup {
                object: name.clone(),
                pose: first_pose + index,
                demonstrations: grasp.rotated(*turn),
                encodings: encodings.to_vec(),
                has_starts: *turn == 0.0,
                neighbor_starts: Vec::new(),
            }));
        }
    }
    Ok((train, held_out))
}

/// The training demonstrations of a dataset, with the object azimuth of each pose, for playback without a
/// policy.
pub fn demonstration_library(dataset: &Dataset) -> Result<DemonstrationLibrary> {
    let mut library = DemonstrationLibrary::default();
    for object in 0..dataset.config.objects.len() {
        for (index, record) in dataset.read_poses(object)?.into_iter().enumerate() {
            let Some(cloud) = record.clouds.first().filter(|_| !is_held_out(index)) else {
                continue;
            };
            let (azimuth, _) = policy::observation::canonicalize(&net::to_points(cloud));
            let observation = Observation { azimuth, latent: Vec::new() };
            let demonstrations = DemoTrajectories::new(record.states, record.offsets);
            for trajectory in 0..demonstrations.num_trajectories() {
                let (first, end) = demonstrations.row_range(trajectory);
                library.add(&observation, (first..end).map(|row| demonstrations.state(row)));
            }
        }
    }
    Ok(library)
}
