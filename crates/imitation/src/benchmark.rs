//! Benchmark of a training step with all networks, and of its matrix products alone. A DAgger step also
//! contains the expert, the fingertip loss and the rollout; they are excluded here and in the PyTorch
//! baseline.

use crate::nn::Params;
use crate::nn::adam::AdamW;
use crate::nn::networks::autoencoder as net;
use crate::nn::networks::ngf::TrainableSet;
use crate::nn::networks::{self, Network, NetworkOutput};
use crate::train::autoencoder::{self, Example};
use crate::train::backward::{self, Batch, Loss};
use crate::train::data_parallel::differentiate;
use anyhow::{Context, Result};
use candle_core::{Device, Tensor};
use configs::{AutoencoderConfig, DaggerConfig};
use evaluation::percentiles::median;
use objects::shape_moments::NUM_MOMENTS;
use policy::LATENT_DIM;
use policy::PolicyConfig;
use policy::encoder::CLOUD_POINTS;
use policy::networks::fourier::{NUM_FEATURES, NUM_FREQUENCIES};
use policy::networks::ngf::{HIDDEN_WIDTH, POTENTIAL, SUBNETWORKS, VelocityInput};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState, JointVector, KinematicTree};
use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Instant;

/// Number of measured steps, after the same number of warm-up steps.
const MEASURED_STEPS: usize = 8;

/// Names and median times (ms):
/// - a training step of the NGF,
/// - its matrix products alone, divided evenly among the threads, with operands in the cache,
/// - the same with operands in main memory, as in a real step,
/// - a training step of the encoder.
pub fn rows() -> Result<Vec<(&'static str, f64)>> {
    let policy = PolicyConfig::by_name("ngf-pcd").context("no policy named ngf-pcd")?;
    let config = DaggerConfig::standard(policy);
    Ok(vec![
        ("ngf_training_step", ngf(&config)?),
        ("ngf_training_gemm", gemm_only(config.batch, 0)? / config.threads as f64),
        (
            "ngf_training_gemm_cold",
            gemm_only(config.batch, CACHE_COLD_BYTES)? / config.threads as f64,
        ),
        ("encoder_training_step", encoder(&AutoencoderConfig::standard())?),
    ])
}

/// Working set (bytes) that exceeds all caches, about the size of a step's weights, moments and gradients.
const CACHE_COLD_BYTES: usize = 96 << 20;

/// Median time of `work` (ms).
fn median_ms(mut work: impl FnMut() -> Result<()>) -> Result<f64> {
    let mut times = Vec::new();
    for _ in 0..2 * MEASURED_STEPS {
        let start = Instant::now();
        work()?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    median(times.split_off(MEASURED_STEPS)).context("no step was measured")
}

/// Time (ms) of a step of all five networks: features, gradient of ψ, solve, loss, gradients, AdamW.
fn ngf(config: &DaggerConfig) -> Result<f64> {
    let tree = KinematicTree::iiwa7_allegro()?;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut params = Params::default();
    networks::init(&mut params, &config.policy, &mut rng)?;
    let network = Network::new(&config.policy, &tree)?;
    let mut adam = AdamW::new(&params, 1e-4);
    let mut vector = || JointVector::from_fn(|_, _| rng.random_range(-0.5..0.5));
    let states: Vec<JointState> =
        (0..config.batch).map(|_| JointState { q: vector(), qd: vector() }).collect();
    let z = vec![0.5f32; LATENT_DIM];
    let objects = vec![z.as_slice(); states.len()];
    let batch = Batch { states: &states, observations: &objects };
    let loss = |_: Range<usize>, response: &NetworkOutput| {
        let error = (&response.accelerations - 1.0)?;
        let reported = (error.sqr()?.sum(1)? + 1e-6)?.sqrt()?.mean_all()?;
        Loss::with_metric_penalty(reported, response, config.metric_weight)
    };
    median_ms(|| {
        let result = backward::differentiate(
            &network,
            &params,
            &batch,
            TrainableSet::All,
            config.threads,
            &loss,
        )?;
        adam.step(&params, &result.gradients, config.learning_rate, 10.0, config.threads)?;
        Ok(())
    })
}

/// Time (ms) on one thread of the matrix products that a step with `rows` states needs. Each product cycles
/// through operand pairs with a total size of `bytes`, or uses one pair if it is larger.
fn gemm_only(rows: usize, bytes: usize) -> Result<f64> {
    let mut counts: BTreeMap<[usize; 3], usize> = BTreeMap::new();
    let mut add = |m: usize, k: usize, n: usize| *counts.entry([m, k, n]).or_insert(0) += 1;
    for (index, part) in SUBNETWORKS.iter().enumerate() {
        let velocity = if part.velocity == VelocityInput::Absent { 0 } else { DOF };
        add(rows, DOF + velocity + LATENT_DIM, NUM_FREQUENCIES);
        let widths = [NUM_FEATURES, HIDDEN_WIDTH, HIDDEN_WIDTH, HIDDEN_WIDTH, part.num_outputs];
        let is_potential = index == POTENTIAL;
        // ψ itself is not evaluated: its last layer contributes only its weights.
        let layers = if is_potential { 3 } else { 4 };
        for (layer, pair) in widths.windows(2).take(layers).enumerate() {
            let [inputs, outputs] = [pair[0], pair[1]];
            add(rows, inputs, outputs);
            add(inputs, rows, outputs);
            if layer > 0 {
                add(rows, outputs, inputs);
            }
            if is_potential {
                // The vector-Jacobian product of the layer, and its two gradients.
                add(rows, outputs, inputs);
                add(rows, inputs, outputs);
                add(outputs, rows, inputs);
            }
        }
        if is_potential {
            add(rows, NUM_FREQUENCIES, DOF);
            add(rows, DOF, NUM_FREQUENCIES);
        }
    }
    let mut sum = 0.0;
    for ([m, k, n], count) in counts {
        let matrix = |rows, columns| Tensor::rand(-1f32, 1.0, (rows, columns), &Device::Cpu);
        let pairs = (bytes / (4 * (m * k + k * n + m * n))).max(1);
        let pairs = (0..pairs).map(|_| Ok((matrix(m, k)?, matrix(k, n)?)));
        let pairs = pairs.collect::<Result<Vec<_>>>()?;
        let once = median_ms(|| {
            for (a, b) in &pairs {
                std::hint::black_box(a.matmul(b)?);
            }
            Ok(())
        })?;
        sum += count as f64 * once / pairs.len() as f64;
    }
    Ok(sum)
}

/// Time (ms) of an autoencoder step: encode, decode, Chamfer distance, gradients, AdamW.
fn encoder(config: &AutoencoderConfig) -> Result<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut params = Params::default();
    net::init(&mut params, &mut rng)?;
    net::init_moments(&mut params, &mut rng)?;
    let mut adam = AdamW::new(&params, 1e-4);
    let mut point = |axis: usize| [0.6, 0.0, -0.15][axis] + rng.random_range(-0.1f32..0.1);
    let mut cloud = || (0..3 * CLOUD_POINTS).map(|i| point(i % 3)).collect();
    let examples: Vec<Example> =
        (0..config.batch).map(|_| Example::new(cloud(), [0.0; NUM_MOMENTS])).collect();
    let batch: Vec<&Example> = examples.iter().collect();
    median_ms(|| {
        let gradients = differentiate(&batch, autoencoder::MICRO_BATCH, config.threads, |batch| {
            autoencoder::loss(&params, batch, config)
        })?;
        adam.step(&params, &gradients, config.learning_rate, 1.0, config.threads)?;
        Ok(())
    })
}
