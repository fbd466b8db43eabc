//! Training the autoencoder: Chamfer distance plus the squared norm of z (paper §III-D).

use crate::dataset::Dataset;
use crate::nn::adam::{AdamW, schedule};
use crate::nn::chamfer::Chamfer;
use crate::nn::{Params, autoencoder as twin};
use crate::shards::{Gradient, sum_over_shards};
use crate::store;
use anyhow::{Result, bail};
use policy::encoder::LATENT;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// How the autoencoder is trained; the paper gives the two losses, the figures are ours.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct AutoencoderConfig {
    /// Optimiser steps.
    pub steps: u64,
    /// Clouds a step, over all shards.
    pub batch: usize,
    /// Shards, one thread each.
    pub shards: usize,
    /// Peak learning rate.
    pub rate: f32,
    /// Weight of the squared norm of z.
    pub latent_weight: f64,
    /// Seed of weights and batches.
    pub seed: u64,
}

impl AutoencoderConfig {
    /// About an hour on two cores.
    pub fn standard() -> Self {
        Self { steps: 12_000, batch: 32, shards: 2, rate: 1e-3, latent_weight: 1e-4, seed: 0 }
    }
}

/// z of a set of clouds: mean and spread, for standardising.
pub struct LatentScale {
    /// Mean of each entry.
    pub mean: Vec<f32>,
    /// Spread of each entry, not less than a tenth of the largest one: what hardly varies is noise.
    pub scale: Vec<f32>,
}

/// Trains on the dataset's clouds and writes `encoder.safetensors` to `out`; continues from a
/// checkpoint that is there. `progress` gets step, steps, and the mean loss since the last call.
pub fn train(
    dataset: &Dataset,
    config: &AutoencoderConfig,
    out: &Path,
    progress: &mut dyn FnMut(u64, u64, f32),
) -> Result<()> {
    let clouds = dataset.encoder_clouds()?;
    if clouds.is_empty() {
        bail!("the dataset has no clouds for the encoder");
    }
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut params = Params::default();
    twin::init(&mut params, &mut rng)?;
    let mut adam = AdamW::new(params.count(), 1e-4);
    let checkpoint = out.join("encoder.checkpoint.safetensors");
    crate::checkpoint::load(&checkpoint, &params, &mut adam)?;

    let mut values = params.values()?;
    let mut since = Vec::new();
    while adam.steps < config.steps {
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed ^ (adam.steps + 1) << 20);
        let batch: Vec<&[f32]> = (0..config.batch)
            .map(|_| clouds[rng.random_range(0..clouds.len())].as_slice())
            .collect();
        let gradient = sum_over_shards(&batch, config.shards, |part| loss(&params, part, config))?;
        let rate = schedule(adam.steps, 200, config.steps, config.rate);
        adam.step(&mut values, &gradient.values, rate, 1.0);
        params.set_values(&values)?;
        since.push(gradient.loss);
        if adam.steps.is_multiple_of(50) {
            progress(adam.steps, config.steps, since.iter().sum::<f32>() / since.len() as f32);
            since.clear();
        }
        if adam.steps.is_multiple_of(500) {
            crate::checkpoint::save(&checkpoint, &params, &adam)?;
        }
    }
    let scale = latent_scale(&params, &clouds)?;
    let mut tensors = params.save()?;
    store::write(&out.join("encoder.safetensors"), &tensors)?;
    tensors = store::encode(
        &[("mean", vec![LATENT], &scale.mean), ("scale", vec![LATENT], &scale.scale)],
        None,
    )?;
    store::write(&out.join("latent.safetensors"), &tensors)
}

/// Mean loss of a part of the batch and its gradient.
fn loss(params: &Params, clouds: &[&[f32]], config: &AutoencoderConfig) -> Result<Gradient> {
    let z = twin::encode(params, clouds)?;
    let made = twin::decode(params, &z)?;
    let chamfer = made.apply_op2(&twin::targets(clouds)?, Chamfer)?.mean_all()?;
    let size = (z.sqr()?.mean_all()? * config.latent_weight)?;
    let store = (&chamfer + size)?.backward()?;
    Ok(Gradient { loss: chamfer.to_scalar::<f32>()?, values: params.gradients(&store)? })
}

/// z of clouds, not standardised.
pub fn encode_all(params: &Params, clouds: &[Vec<f32>]) -> Result<Vec<Vec<f32>>> {
    let mut latents = Vec::with_capacity(clouds.len());
    for part in clouds.chunks(32) {
        let part: Vec<&[f32]> = part.iter().map(Vec::as_slice).collect();
        latents.extend(twin::encode(params, &part)?.to_vec2::<f32>()?);
    }
    Ok(latents)
}

fn latent_scale(params: &Params, clouds: &[Vec<f32>]) -> Result<LatentScale> {
    let latents = encode_all(params, &clouds[..clouds.len().min(20_000)])?;
    let count = latents.len() as f32;
    let mean: Vec<f32> =
        (0..LATENT).map(|i| latents.iter().map(|z| z[i]).sum::<f32>() / count).collect();
    let spread = |i: usize| {
        let square = |z: &Vec<f32>| (z[i] - mean[i]) * (z[i] - mean[i]);
        (latents.iter().map(square).sum::<f32>() / count).sqrt()
    };
    let spreads: Vec<f32> = (0..LATENT).map(spread).collect();
    let largest = spreads.iter().copied().fold(1e-6, f32::max);
    Ok(LatentScale { mean, scale: spreads.iter().map(|s| s.max(0.1 * largest)).collect() })
}
