//! Training the autoencoder: Chamfer distance plus the mean square of z (paper §III-D), and the moments of the whole
//! object.

use crate::fit::{self, Fit};
use crate::moments::{MOMENTS, Scale, moments};
use crate::nn::chamfer::Chamfer;
use crate::nn::{Params, autoencoder as twin};
use crate::shards::Gradient;
use crate::watcher::Watcher;
use anyhow::{Result, bail};
use candle_core::{Device, Tensor};
use dataset::Dataset;
use dataset::store;
use nalgebra::DMatrix;
use policy::Whitening;
use policy::encoder::LATENT;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// How the autoencoder is trained; the paper gives the two losses, the figures are ours.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct AutoencoderConfig {
    /// Optimiser steps.
    pub steps: u64,
    /// Clouds a step.
    pub batch: usize,
    /// Threads.
    pub threads: usize,
    /// Peak learning rate.
    pub rate: f32,
    /// Weight of the mean square of z.
    pub latent_weight: f64,
    /// Weight of the moments of the whole surface, read linearly from z ([`crate::moments`]).
    pub moment_weight: f64,
    /// Steps from checkpoint to checkpoint.
    pub span: u64,
    /// Seed of weights and batches.
    pub seed: u64,
}

/// What the autoencoder learns from: a cloud turned to the front, and the moments of the whole object there.
#[derive(Clone, Debug)]
pub struct Example {
    /// 512 x 3.
    cloud: Vec<f32>,
    /// Its neighbourhoods, which do not change from step to step.
    neighborhoods: Vec<twin::Neighborhood>,
    /// In units of their spread.
    moments: [f32; MOMENTS],
}

impl Example {
    /// A cloud (512 x 3) turned to the front, and the moments of the whole object there, in units of their spread.
    pub fn new(cloud: Vec<f32>, moments: [f32; MOMENTS]) -> Self {
        Self { neighborhoods: twin::neighborhoods_of(&cloud), cloud, moments }
    }
}

/// The examples of a dataset.
fn examples(dataset: &Dataset) -> Result<Vec<Example>> {
    let surfaces = dataset.surfaces()?;
    let (mut clouds, mut raw) = (Vec::new(), Vec::new());
    for view in dataset.encoder_views()? {
        let (bearing, cloud) = to_front(&view.cloud);
        raw.push(moments(&surfaces[view.object], pose_in_front(view.pose, bearing)));
        clouds.push(cloud);
    }
    let scale = Scale::of(&raw);
    let example = |(cloud, raw): (Vec<f32>, &_)| Example::new(cloud, scale.apply(raw));
    Ok(clouds.into_iter().zip(&raw).map(example).collect())
}

/// An object pose x, y (m), yaw (rad) with the object turned to the front from its bearing (rad).
pub fn pose_in_front(pose: [f32; 3], bearing: f64) -> [f32; 3] {
    dataset::poses::turned(pose, -bearing as f32)
}

impl AutoencoderConfig {
    /// A quarter of an hour on two cores. On the clouds of preset `families` (seed 0) the yaw of the bleach bottle is then
    /// read off z within 5.0 degrees (median); with a third of the steps and a tenth of the weight of the moments, 8.7.
    pub fn standard() -> Self {
        Self {
            steps: 36_000,
            batch: 32,
            threads: 2,
            rate: 1e-3,
            latent_weight: 1e-4,
            moment_weight: 0.5,
            span: 500,
            seed: 0,
        }
    }

    /// As long as a dataset's preset is worth ([`dataset::config::PRESETS`]).
    pub fn preset(name: &str) -> Option<Self> {
        let standard = Self::standard();
        Some(match name {
            "smoke" => Self { steps: 40, ..standard },
            "small" => Self { steps: 3000, ..standard },
            "variants" | "paper" | "families" => standard,
            _ => return None,
        })
    }
}

/// Spread along an axis, as a share of the largest one, below which an axis is taken for noise.
const LEAST_SPREAD: f64 = 0.05;

/// Clouds that are differentiated at once: what lies between the layers then stays in the cache.
pub(crate) const PIECE: usize = 4;

/// Clouds at most from which the whitening is computed.
const WHITENED: usize = 20_000;

/// Trains on the dataset's clouds and writes `encoder.safetensors` to `out`; continues from a
/// checkpoint that is there. A watcher may stop it: then nothing but the checkpoint is written, and it says `false`.
pub fn train(
    dataset: &Dataset,
    config: &AutoencoderConfig,
    out: &Path,
    watcher: &mut dyn Watcher,
) -> Result<bool> {
    let examples = examples(dataset)?;
    if examples.is_empty() {
        bail!("the dataset has no clouds for the encoder");
    }
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut params = Params::default();
    twin::init(&mut params, &mut rng)?;
    twin::init_moments(&mut params, &mut rng)?;
    let fit = Fit {
        steps: config.steps,
        batch: config.batch,
        piece: PIECE,
        threads: config.threads,
        rate: config.rate,
        span: config.span,
        seed: config.seed,
        checkpoint: &out.join("encoder.checkpoint.safetensors"),
        settings: fit::settings(config, "data", dataset.hash()?)?,
    };
    if !fit.run(&params, &examples, |part| loss(&params, part, config), watcher)? {
        return Ok(false);
    }
    // Every object has its share.
    let shown = examples.iter().step_by(examples.len().div_ceil(WHITENED));
    let shown: Vec<Vec<f32>> = shown.map(|example| example.cloud.clone()).collect();
    let latents = encode_all(&params, &shown)?;
    store::write(&out.join("encoder.safetensors"), &params.save()?)?;
    let whitening = store::encode(&whiten(&latents).tensors(), None)?;
    store::write(&out.join("latent.safetensors"), &whitening)?;
    Ok(true)
}

/// Mean loss of a part of the batch and its gradient.
pub fn loss(
    params: &Params,
    examples: &[&Example],
    config: &AutoencoderConfig,
) -> Result<Gradient> {
    let params = &params.of_shard();
    let clouds: Vec<&[f32]> = examples.iter().map(|example| example.cloud.as_slice()).collect();
    let near: Vec<&[twin::Neighborhood]> =
        examples.iter().map(|example| example.neighborhoods.as_slice()).collect();
    let z = twin::encode_among(params, &clouds, &near)?;
    let made = twin::decode(params, &z)?;
    let chamfer = made.apply_op2(&twin::targets(&clouds)?, Chamfer::default())?.mean_all()?;
    let size = (z.sqr()?.mean_all()? * config.latent_weight)?;
    let wanted = examples.iter().flat_map(|example| example.moments).collect::<Vec<f32>>();
    let wanted = Tensor::from_vec(wanted, (examples.len(), MOMENTS), &Device::Cpu)?;
    let off = (twin::moments(params, &z)? - wanted)?.sqr()?.mean_all()?;
    let moments = (off * config.moment_weight)?;
    let gradient = Gradient::of(&((&chamfer + size)? + moments)?, params)?;
    Ok(Gradient { loss: chamfer.to_scalar::<f32>()?, ..gradient })
}

/// A cloud turned to the front, and its bearing (rad).
pub fn to_front(cloud: &[f32]) -> (f64, Vec<f32>) {
    let (bearing, front) = policy::encoding::to_front(&twin::points(cloud));
    (bearing, front.iter().flat_map(|p| p.to_array()).collect())
}

/// z of clouds that have been turned to the front, not standardised.
pub fn encode_all(params: &Params, clouds: &[Vec<f32>]) -> Result<Vec<Vec<f32>>> {
    let mut latents = Vec::with_capacity(clouds.len());
    for part in clouds.chunks(32) {
        let part: Vec<&[f32]> = part.iter().map(Vec::as_slice).collect();
        latents.extend(twin::encode(params, &part)?.to_vec2::<f32>()?);
    }
    Ok(latents)
}

/// Mean, principal axes and spread of a set of z.
pub fn whiten(latents: &[Vec<f32>]) -> Whitening {
    let count = latents.len().max(1) as f64;
    let rows = latents.iter().flat_map(|z| z.iter().map(|z| *z as f64));
    let z = DMatrix::from_row_iterator(latents.len(), LATENT, rows);
    let mean = z.row_sum() / count;
    let centered = DMatrix::from_fn(z.nrows(), LATENT, |row, i| z[(row, i)] - mean[i]);
    let eigen = (centered.transpose() * &centered / count).symmetric_eigen();
    let mut order: Vec<usize> = (0..LATENT).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let spread = |i: usize| eigen.eigenvalues[i].max(0.0).sqrt();
    let least = (LEAST_SPREAD * spread(order[0])).max(1e-6);
    let axis = |&i: &usize| eigen.eigenvectors.column(i).iter().map(|x| *x as f32).collect();
    Whitening {
        mean: mean.iter().map(|x| *x as f32).collect(),
        axes: order.iter().flat_map(|i| -> Vec<f32> { axis(i) }).collect(),
        scale: order.iter().map(|&i| spread(i).max(least) as f32).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn whitened_latents_have_unit_covariance() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        // Each entry depends on those before it; the spreads differ by a factor of eight.
        let draw = |_| {
            let mut z: Vec<f32> = vec![0.0; LATENT];
            for i in 0..LATENT {
                let before = if i > 0 { z[i - 1] } else { 0.0 };
                z[i] = 0.5 * before + (1.0 + (i % 8) as f32) * rng.random_range(-1.0..1.0) + 0.3;
            }
            z
        };
        let latents: Vec<Vec<f32>> = (0..4000).map(draw).collect();
        let whitening = whiten(&latents);
        let white: Vec<Vec<f32>> = latents.iter().map(|z| whitening.apply(z)).collect();
        let mean = |f: &dyn Fn(&[f32]) -> f32| white.iter().map(|z| f(z)).sum::<f32>() / 4000.0;
        for i in 0..LATENT {
            for j in 0..=i {
                let wanted = f32::from(i == j);
                let covariance = mean(&|z| z[i] * z[j]);
                assert!((covariance - wanted).abs() < 0.01, "{i}, {j}: {covariance}");
            }
        }
    }

    #[test]
    fn what_does_not_vary_stays_small() {
        let latents: Vec<Vec<f32>> = (0..100)
            .map(|k| (0..LATENT).map(|i| if i == 4 { k as f32 } else { 1e-4 * k as f32 }).collect())
            .collect();
        let whitening = whiten(&latents);
        let white = whitening.apply(&latents[99]);
        assert!(white[0].abs() > 1.0 && white[1..].iter().all(|z| z.abs() < 0.01), "{white:?}");
    }
}
