//! Training of the autoencoder (encoder and decoder): Chamfer distance plus mean square of z (paper §III-D),
//! plus shape moments of the whole object.

use crate::data::grasp_points::{GRASP_DIM, grasp_views};
use crate::nn::Params;
use crate::nn::networks::autoencoder as net;
use crate::nn::ops::chamfer::Chamfer;
use crate::train::callback::TrainingCallback;
use crate::train::data_parallel::Gradient;
use crate::train::supervised::{self, SupervisedTrainer};
use anyhow::{Result, bail};
use candle_core::{Device, Tensor};
use configs::AutoencoderConfig;
use dataset::Dataset;
use files::{atomic_file, tensors};
use nalgebra::DMatrix;
use objects::shape_moments::{NUM_MOMENTS, Standardizer, moments};
use policy::LATENT_DIM;
use policy::Whitening;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use robot::KinematicTree;
use std::path::Path;

/// A training example: a cloud in the canonical frame, and the shape moments of the whole object in that
/// frame.
#[derive(Clone, Debug)]
pub struct Example {
    /// Points (m, canonical frame), 512 x 3.
    cloud: Vec<f32>,
    /// Neighbourhoods of the cloud, computed once because they do not change during training.
    neighborhoods: Vec<net::Neighborhood>,
    /// Standardised shape moments.
    moments: [f32; NUM_MOMENTS],
    /// Points of the hand in the preferred grasp ([`crate::data::grasp_points::grasp_points`]); `None` at random poses.
    grasp: Option<[f32; GRASP_DIM]>,
}

impl Example {
    /// `cloud`: 512 x 3 (m, canonical frame). `moments`: standardised shape moments in that frame.
    pub fn new(cloud: Vec<f32>, moments: [f32; NUM_MOMENTS]) -> Self {
        Self { neighborhoods: net::neighborhoods_of(&cloud), cloud, moments, grasp: None }
    }
}

/// The encoder samples of a dataset as training examples and, with a weight, the clouds of demonstrated poses.
fn examples(dataset: &Dataset, config: &AutoencoderConfig) -> Result<Vec<Example>> {
    let surfaces = dataset.surfaces()?;
    let (mut clouds, mut raw) = (Vec::new(), Vec::new());
    for view in dataset.encoder_samples()? {
        let (azimuth, cloud) = canonicalize(&view.cloud);
        raw.push(moments(&surfaces[view.object], canonical_pose(view.pose, azimuth)));
        clouds.push((cloud, None));
    }
    let standardizer = Standardizer::fit(&raw);
    if config.grasp_weight > 0.0 {
        let names = &dataset.config.encoder_objects;
        for view in grasp_views(dataset, &KinematicTree::iiwa7_allegro()?)? {
            let name = &dataset.config.objects[view.object];
            // Surfaces are those of the encoder's objects.
            let Some(object) = names.iter().position(|other| other == name) else { continue };
            raw.push(moments(&surfaces[object], view.pose));
            clouds.push((view.cloud, Some(view.grasp)));
        }
    }
    let example = |((cloud, grasp), raw): ((Vec<f32>, _), &_)| Example {
        grasp,
        ..Example::new(cloud, standardizer.apply(raw))
    };
    Ok(clouds.into_par_iter().zip(&raw).map(example).collect())
}

/// Object pose x, y (m), yaw (rad) in the canonical frame, for an object at the given azimuth (rad).
pub fn canonical_pose(pose: [f32; 3], azimuth: f64) -> [f32; 3] {
    dataset::planar_pose::rotate_pose(pose, -azimuth as f32)
}

/// Min. standard deviation of a whitened axis, as a fraction of the largest one; axes below it are treated as
/// noise.
const MIN_STD_FRACTION: f64 = 0.05;

/// Clouds per backward pass, small enough that the activations stay in the cache.
pub(crate) const MICRO_BATCH: usize = 4;

/// Max. number of clouds for the whitening statistics.
const MAX_WHITENING_CLOUDS: usize = 20_000;

/// Trains on the dataset's clouds and writes `encoder.safetensors` and `latent.safetensors` to `out`; resumes
/// from a checkpoint in `out`. Returns `false`, with only the checkpoint written, if the callback stops the
/// training.
pub fn train(
    dataset: &Dataset,
    config: &AutoencoderConfig,
    out: &Path,
    watcher: &mut dyn TrainingCallback,
) -> Result<bool> {
    let examples = examples(dataset, config)?;
    if examples.is_empty() {
        bail!("the dataset has no clouds for encoder training; generate it with encoder objects");
    }
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut params = Params::default();
    net::init(&mut params, &mut rng)?;
    net::init_moments(&mut params, &mut rng)?;
    net::init_grasp(&mut params, &mut rng)?;
    let trainer = SupervisedTrainer {
        steps: config.steps,
        batch: config.batch,
        micro_batch: MICRO_BATCH,
        threads: config.threads,
        learning_rate: config.learning_rate,
        checkpoint_every: config.checkpoint_every,
        seed: config.seed,
        checkpoint: &out.join("encoder.checkpoint.safetensors"),
        settings: supervised::checkpoint_settings(config, "dataset", dataset.hash()?)?,
    };
    if !trainer.run(&params, &examples, |batch| loss(&params, batch, config), watcher)? {
        return Ok(false);
    }
    // Evenly spaced examples represent all objects.
    let clouds = examples.iter().step_by(examples.len().div_ceil(MAX_WHITENING_CLOUDS));
    let clouds: Vec<Vec<f32>> = clouds.map(|example| example.cloud.clone()).collect();
    let latents = encode_all(&params, &clouds)?;
    atomic_file::write(&out.join("encoder.safetensors"), &params.save()?)?;
    let whitening = tensors::encode(&fit_whitening(&latents).tensors(), None)?;
    atomic_file::write(&out.join("latent.safetensors"), &whitening)?;
    Ok(true)
}

/// Mean loss of a micro-batch and its gradient. The reported loss is the Chamfer distance alone.
pub fn loss(
    params: &Params,
    examples: &[&Example],
    config: &AutoencoderConfig,
) -> Result<Gradient> {
    let params = &params.with_accumulators();
    let clouds: Vec<&[f32]> = examples.iter().map(|example| example.cloud.as_slice()).collect();
    let neighborhoods: Vec<&[net::Neighborhood]> =
        examples.iter().map(|example| example.neighborhoods.as_slice()).collect();
    let z = net::encode_with_neighborhoods(params, &clouds, &neighborhoods)?;
    let decoded = net::decode(params, &z)?;
    let chamfer = decoded.apply_op2(&net::targets(&clouds)?, Chamfer::default())?.mean_all()?;
    let latent = (z.sqr()?.mean_all()? * config.latent_weight)?;
    let target = examples.iter().flat_map(|example| example.moments).collect::<Vec<f32>>();
    let target = Tensor::from_vec(target, (examples.len(), NUM_MOMENTS), &Device::Cpu)?;
    let error = (net::moments(params, &z)? - target)?.sqr()?.mean_all()?;
    let moments = (error * config.moment_weight)?;
    let mut loss = ((&chamfer + latent)? + moments)?;
    if let Some(distance) = grasp_distance(params, &z, examples)? {
        loss = (loss + (distance * config.grasp_weight)?)?;
    }
    let gradient = Gradient::compute(&loss, params)?;
    Ok(Gradient { loss: chamfer.to_scalar::<f32>()?, ..gradient })
}

/// Mean distance of the predicted points of the hand from those of the preferred grasp (workspace units), over all
/// examples; those without a grasp count as 0. `None` if there are none.
///
/// The distance instead of its square: of two grasps at similar poses, the more frequent one is learned, not their mean.
fn grasp_distance(params: &Params, z: &Tensor, examples: &[&Example]) -> Result<Option<Tensor>> {
    let rows: Vec<u32> =
        (0..examples.len()).filter(|&i| examples[i].grasp.is_some()).map(|i| i as u32).collect();
    if rows.is_empty() {
        return Ok(None);
    }
    let target: Vec<f32> = examples.iter().filter_map(|example| example.grasp).flatten().collect();
    let (count, points) = (rows.len(), GRASP_DIM / 3);
    let target = Tensor::from_vec(target, (count, points, 3), &Device::Cpu)?;
    let z = z.index_select(&Tensor::from_vec(rows, count, &Device::Cpu)?, 0)?;
    let error = (net::grasp(params, &z)?.reshape((count, points, 3))? - target)?;
    let distance = (error.sqr()?.sum(2)? + MIN_SQUARED_DISTANCE)?.sqrt()?;
    Ok(Some((distance.mean(1)?.sum_all()? / examples.len() as f64)?))
}

/// Keeps the gradient of a distance finite at 0.
const MIN_SQUARED_DISTANCE: f64 = 1e-6;

/// The azimuth (rad) of a cloud (m, base frame), and the cloud rotated into the canonical frame.
pub fn canonicalize(cloud: &[f32]) -> (f64, Vec<f32>) {
    let (azimuth, canonical) = policy::observation::canonicalize(&net::to_points(cloud));
    (azimuth, canonical.iter().flat_map(|p| p.to_array()).collect())
}

/// Raw z, before whitening, of clouds in the canonical frame.
pub fn encode_all(params: &Params, clouds: &[Vec<f32>]) -> Result<Vec<Vec<f32>>> {
    let encode = |batch: &[Vec<f32>]| {
        let batch: Vec<&[f32]> = batch.iter().map(Vec::as_slice).collect();
        Ok(net::encode(params, &batch)?.to_vec2::<f32>()?)
    };
    Ok(clouds.par_chunks(32).map(encode).collect::<Result<Vec<_>>>()?.concat())
}

/// Mean, principal axes and standard deviations of a set of raw z.
pub fn fit_whitening(latents: &[Vec<f32>]) -> Whitening {
    let count = latents.len().max(1) as f64;
    let rows = latents.iter().flat_map(|z| z.iter().map(|z| *z as f64));
    let z = DMatrix::from_row_iterator(latents.len(), LATENT_DIM, rows);
    let mean = z.row_sum() / count;
    let centered = DMatrix::from_fn(z.nrows(), LATENT_DIM, |row, i| z[(row, i)] - mean[i]);
    let eigen = (centered.transpose() * &centered / count).symmetric_eigen();
    let mut order: Vec<usize> = (0..LATENT_DIM).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let spread = |i: usize| eigen.eigenvalues[i].max(0.0).sqrt();
    let min = (MIN_STD_FRACTION * spread(order[0])).max(1e-6);
    let axis = |&i: &usize| eigen.eigenvectors.column(i).iter().map(|x| *x as f32).collect();
    Whitening {
        mean: mean.iter().map(|x| *x as f32).collect(),
        axes: order.iter().flat_map(|i| -> Vec<f32> { axis(i) }).collect(),
        scale: order.iter().map(|&i| spread(i).max(min) as f32).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn grasp_distance_is_the_mean_over_points_and_examples() {
        let mut params = Params::default();
        net::init_grasp(&mut params, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        let z = Tensor::from_vec(vec![0.3f32; 2 * LATENT_DIM], (2, LATENT_DIM), &Device::Cpu);
        let z = z.unwrap();
        let mut grasp = [0.0; GRASP_DIM];
        let predicted = net::grasp(&params, &z).unwrap().to_vec2::<f32>().unwrap();
        grasp.copy_from_slice(&predicted[0]);
        // Each point is off by 3 along x and 4 along z.
        for point in grasp.chunks_exact_mut(3) {
            point[0] += 3.0;
            point[2] -= 4.0;
        }
        let cloud = || vec![0.5; 3 * policy::encoder::CLOUD_POINTS];
        let at_random = Example::new(cloud(), [0.0; NUM_MOMENTS]);
        let demonstrated = Example { grasp: Some(grasp), ..at_random.clone() };
        let distance = |examples: &[&Example]| {
            let found = grasp_distance(&params, &z, examples).unwrap();
            found.map(|found| found.to_scalar::<f32>().unwrap())
        };
        assert_eq!(distance(&[&at_random, &at_random]), None);
        let [one, both] = [[&at_random, &demonstrated], [&demonstrated, &demonstrated]]
            .map(|examples| distance(&examples).unwrap());
        assert!((one - 2.5).abs() < 1e-4 && (both - 5.0).abs() < 1e-4, "{one} {both}");
    }

    #[test]
    fn whitened_latents_have_unit_covariance() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        // Each entry depends on the previous one; the standard deviations differ by a factor of eight.
        let draw = |_| {
            let mut z: Vec<f32> = vec![0.0; LATENT_DIM];
            for i in 0..LATENT_DIM {
                let before = if i > 0 { z[i - 1] } else { 0.0 };
                z[i] = 0.5 * before + (1.0 + (i % 8) as f32) * rng.random_range(-1.0..1.0) + 0.3;
            }
            z
        };
        let latents: Vec<Vec<f32>> = (0..4000).map(draw).collect();
        let whitening = fit_whitening(&latents);
        let white: Vec<Vec<f32>> = latents.iter().map(|z| whitening.apply(z)).collect();
        let mean = |f: &dyn Fn(&[f32]) -> f32| white.iter().map(|z| f(z)).sum::<f32>() / 4000.0;
        for i in 0..LATENT_DIM {
            for j in 0..=i {
                let expected = f32::from(i == j);
                let covariance = mean(&|z| z[i] * z[j]);
                assert!((covariance - expected).abs() < 0.01, "{i}, {j}: {covariance}");
            }
        }
    }

    #[test]
    fn nearly_constant_latents_stay_small_after_whitening() {
        let latents: Vec<Vec<f32>> = (0..100)
            .map(|k| {
                (0..LATENT_DIM).map(|i| if i == 4 { k as f32 } else { 1e-4 * k as f32 }).collect()
            })
            .collect();
        let whitening = fit_whitening(&latents);
        let white = whitening.apply(&latents[99]);
        assert!(white[0].abs() > 1.0 && white[1..].iter().all(|z| z.abs() < 0.01), "{white:?}");
    }
}
