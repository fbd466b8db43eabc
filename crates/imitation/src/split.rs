//! What of a dataset is taught, and what is held out.

use crate::encoder::TrainedEncoder;
use crate::expert::Demonstrations;
use crate::lesson::{self, Lesson};
use crate::nn::autoencoder as twin;
use anyhow::Result;
use dataset::Dataset;
use policy::{Encoding, Observation};
use rollout::Library;
use std::sync::Arc;

/// Every tenth object pose is held out.
pub fn is_held_out(index: usize) -> bool {
    index % 10 == 9
}

/// The lessons of a dataset: those to learn from, of the first `poses` poses of each object, and all that are held out.
pub fn lessons(
    dataset: &Dataset,
    encoder: &TrainedEncoder,
    observation: Observation,
    poses: usize,
) -> Result<(Vec<Lesson>, Vec<Lesson>)> {
    let (mut taught, mut held_out) = (Vec::new(), Vec::new());
    for (object, name) in dataset.config.objects.iter().enumerate() {
        let name: Arc<str> = name.as_str().into();
        for (index, record) in dataset.poses(object)?.into_iter().enumerate() {
            let is_left_out = index >= poses && !is_held_out(index);
            if is_left_out || record.offsets.len() < 2 {
                continue;
            }
            let encodings = encoder.observe(observation, &record.clouds)?;
            let ways = Demonstrations::new(record.states, record.offsets).by_grasp();
            let seen = encodings.chunks_exact((encodings.len() / record.turns.len().max(1)).max(1));
            for (turn, encodings) in record.turns.iter().zip(seen) {
                let lessons = if is_held_out(index) { &mut held_out } else { &mut taught };
                lessons.extend(ways.iter().map(|way| Lesson {
                    object: name.clone(),
                    pose: object * dataset.config.poses + index,
                    demonstrations: way.turned(*turn),
                    encodings: encodings.to_vec(),
                    has_starts: *turn == 0.0,
                    near: Vec::new(),
                }));
            }
        }
    }
    let among = lesson::starts(&taught);
    lesson::introduce(&mut taught, &among);
    lesson::introduce(&mut held_out, &among);
    Ok((taught, held_out))
}

/// The demonstrations that models trained on a dataset have the starts of.
pub fn library(dataset: &Dataset) -> Result<Library> {
    let mut library = Library::default();
    for object in 0..dataset.config.objects.len() {
        for (index, record) in dataset.poses(object)?.into_iter().enumerate() {
            let Some(cloud) = record.clouds.first().filter(|_| !is_held_out(index)) else {
                continue;
            };
            let (bearing, _) = policy::encoding::to_front(&twin::points(cloud));
            let seen = Encoding { bearing, z: Vec::new() };
            let demonstrations = Demonstrations::new(record.states, record.offsets);
            for trajectory in 0..demonstrations.trajectories() {
                let (first, end) = demonstrations.span(trajectory);
                library.add(&seen, (first..end).map(|row| demonstrations.state(row)));
            }
        }
    }
    Ok(library)
}
