//! How long a step of the optimiser takes with all networks, and what its matrix products alone would. The expert, the
//! fingertips and the roll-out, which a step of DAgger has beside it, are left out, as in the peer's.

use crate::autoencoder::{self, AutoencoderConfig, Example};
use crate::dagger::DaggerConfig;
use crate::moments::MOMENTS;
use crate::nn::adam::AdamW;
use crate::nn::network::{self, Network, Response};
use crate::nn::ngf::Active;
use crate::nn::{Params, autoencoder as twin};
use crate::shards::differentiate;
use crate::spread::median;
use crate::step::{self, Batch, Loss};
use anyhow::{Context, Result};
use candle_core::{Device, Tensor};
use policy::PolicyConfig;
use policy::encoder::{CLOUD, LATENT};
use policy::fourier::{FEATURES, FREQUENCIES};
use policy::ngf::{HIDDEN, PARTS, POTENTIAL, Velocity};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState, JointVector, Tree};
use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Instant;

/// Steps that are measured after as many that are not.
const STEPS: usize = 8;

/// Names and milliseconds: a step of the NGF; what it would take if it were products alone, shared evenly by the threads,
/// of matrices that lie in the cache, and of matrices that come from memory as they do in a step; a step of the encoder.
pub fn rows() -> Result<Vec<(&'static str, f64)>> {
    let policy = PolicyConfig::named("ngf-pcd").context("the policy of the paper")?;
    let config = DaggerConfig::standard(policy);
    Ok(vec![
        ("ngf_training_step", ngf(&config)?),
        ("ngf_training_products", products(config.batch, 0)? / config.threads as f64),
        ("ngf_training_products_cold", products(config.batch, COLD)? / config.threads as f64),
        ("encoder_training_step", encoder(&AutoencoderConfig::standard())?),
    ])
}

/// Bytes of matrices that no cache holds until they are needed again: a step's weights, moments and gradients are about as
/// many.
const COLD: usize = 96 << 20;

/// Median time (ms) of `work`.
fn time(mut work: impl FnMut() -> Result<()>) -> Result<f64> {
    let mut times = Vec::new();
    for _ in 0..2 * STEPS {
        let begin = Instant::now();
        work()?;
        times.push(begin.elapsed().as_secs_f64() * 1e3);
    }
    median(times.split_off(STEPS)).context("nothing was measured")
}

/// A step of all five networks: features, gradient of ψ, solve, loss, gradients, AdamW.
fn ngf(config: &DaggerConfig) -> Result<f64> {
    let limits = Tree::iiwa7_allegro()?.limits;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut params = Params::default();
    network::init(&mut params, &config.policy, &mut rng)?;
    let network = Network::new(&config.policy, &limits)?;
    let mut adam = AdamW::new(&params, 1e-4);
    let mut vector = || JointVector::from_fn(|_, _| rng.random_range(-0.5..0.5));
    let states: Vec<JointState> =
        (0..config.batch).map(|_| JointState { q: vector(), qd: vector() }).collect();
    let z = vec![0.5f32; LATENT];
    let objects = vec![z.as_slice(); states.len()];
    let batch = Batch { states: &states, objects: &objects };
    let loss = |_: Range<usize>, response: &Response| {
        let off = (&response.accelerations - 1.0)?;
        let shown = (off.sqr()?.sum(1)? + 1e-6)?.sqrt()?.mean_all()?;
        Loss::with_metrics(shown, response, config.metric_weight)
    };
    time(|| {
        let outcome =
            step::differentiate(&network, &params, &batch, Active::All, config.threads, &loss)?;
        adam.step(&params, &outcome.gradients, config.rate, 10.0, config.threads)?;
        Ok(())
    })
}

/// Time (ms) of the products that a step with that many states cannot do without, one after another on one thread. Each is
/// measured with pairs of matrices in turn that take so many bytes together, one pair at least.
fn products(rows: usize, bytes: usize) -> Result<f64> {
    let mut counts: BTreeMap<[usize; 3], usize> = BTreeMap::new();
    let mut add = |m: usize, k: usize, n: usize| *counts.entry([m, k, n]).or_insert(0) += 1;
    for (index, part) in PARTS.iter().enumerate() {
        let velocity = if part.velocity == Velocity::Absent { 0 } else { DOF };
        add(rows, DOF + velocity + LATENT, FREQUENCIES);
        let widths = [FEATURES, HIDDEN, HIDDEN, HIDDEN, part.outputs];
        let is_potential = index == POTENTIAL;
        // ψ itself is not needed: its last layer enters by its weights.
        let layers = if is_potential { 3 } else { 4 };
        for (layer, pair) in widths.windows(2).take(layers).enumerate() {
            let [inputs, outputs] = [pair[0], pair[1]];
            add(rows, inputs, outputs);
            add(inputs, rows, outputs);
            if layer > 0 {
                add(rows, outputs, inputs);
            }
            if is_potential {
                // Back through the layer, and the two gradients of that.
                add(rows, outputs, inputs);
                add(rows, inputs, outputs);
                add(outputs, rows, inputs);
            }
        }
        if is_potential {
            add(rows, FREQUENCIES, DOF);
            add(rows, DOF, FREQUENCIES);
        }
    }
    let mut sum = 0.0;
    for ([m, k, n], count) in counts {
        let matrix = |rows, columns| Tensor::rand(-1f32, 1.0, (rows, columns), &Device::Cpu);
        let pairs = (bytes / (4 * (m * k + k * n + m * n))).max(1);
        let pairs = (0..pairs).map(|_| Ok((matrix(m, k)?, matrix(k, n)?)));
        let pairs = pairs.collect::<Result<Vec<_>>>()?;
        let once = time(|| {
            for (a, b) in &pairs {
                std::hint::black_box(a.matmul(b)?);
            }
            Ok(())
        })?;
        sum += count as f64 * once / pairs.len() as f64;
    }
    Ok(sum)
}

/// A step of the autoencoder: encode, decode, Chamfer, gradients, AdamW.
fn encoder(config: &AutoencoderConfig) -> Result<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut params = Params::default();
    twin::init(&mut params, &mut rng)?;
    twin::init_moments(&mut params, &mut rng)?;
    let mut adam = AdamW::new(&params, 1e-4);
    let mut point = |axis: usize| [0.6, 0.0, -0.15][axis] + rng.random_range(-0.1f32..0.1);
    let mut cloud = || (0..3 * CLOUD).map(|i| point(i % 3)).collect();
    let examples: Vec<Example> =
        (0..config.batch).map(|_| Example::new(cloud(), [0.0; MOMENTS])).collect();
    let batch: Vec<&Example> = examples.iter().collect();
    time(|| {
        let gradients = differentiate(&batch, autoencoder::PIECE, config.threads, |part| {
            autoencoder::loss(&params, part, config)
        })?;
        adam.step(&params, &gradients, config.rate, 1.0, config.threads)?;
        Ok(())
    })
}
