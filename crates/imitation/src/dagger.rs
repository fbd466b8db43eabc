//! DAgger with the surrogate expert: the policy visits states, the expert says what to do there
//! (Eq. 2, paper §II-B).

use crate::expert::{self, Demonstrations, Gains};
use crate::nn::Params;
use crate::nn::adam::{AdamW, schedule};
use crate::nn::ngf::{self, Ngf};
use crate::shards::{Gradient, sum_over_shards};
use anyhow::{Result, bail};
use candle_core::{Device, Tensor};
use policy::ngf::NgfConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState, JointVector, Limits, integrator};
use scene::config::CONTROL_PERIOD;
use std::path::Path;

/// How the policy is trained; the paper gives the scheme, the figures are ours.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct DaggerConfig {
    /// Optimiser steps.
    pub steps: u64,
    /// States a step, over all shards.
    pub batch: usize,
    /// Shards, one thread each.
    pub shards: usize,
    /// Peak learning rate.
    pub rate: f32,
    /// Steps that a state is rolled out by the policy before it is drawn anew (H).
    pub horizon: usize,
    /// Uniform noise on a drawn state: position (rad) and velocity (rad/s).
    pub noise: [f64; 2],
    /// The expert.
    pub gains: Gains,
    /// Sizes and scales of the networks.
    pub ngf: NgfConfig,
    /// Seed of weights, states and noise.
    pub seed: u64,
}

impl DaggerConfig {
    /// Full size.
    pub fn standard() -> Self {
        Self {
            steps: 30_000,
            batch: 128,
            shards: 2,
            rate: 1e-3,
            horizon: 30,
            noise: [0.05, 0.1],
            gains: Gains { position: 225.0, velocity: 30.0 },
            ngf: NgfConfig::paper(),
            seed: 0,
        }
    }
}

/// What the policy learns from: the demonstrations of one object pose and z of its clouds.
pub struct Lesson {
    /// Demonstrations.
    pub demonstrations: Demonstrations,
    /// Standardised z of each noisy cloud of the pose.
    pub latents: Vec<Vec<f32>>,
}

/// A state under way.
#[derive(Clone, Copy)]
struct Visit {
    lesson: usize,
    latent: usize,
    state: JointState,
    /// Row of the demonstration that the expert heads for next, and one past its end.
    target: usize,
    end: usize,
    left: usize,
}

/// Trains the five networks; continues from a checkpoint in `out`. `progress` gets step, steps, the
/// mean loss since the last call, and the parameters; it may stop the training by `false`.
pub fn train(
    lessons: &[Lesson],
    limits: &Limits,
    config: &DaggerConfig,
    out: &Path,
    progress: &mut dyn FnMut(u64, u64, f32, &Params) -> Result<bool>,
) -> Result<Params> {
    if !lessons.iter().any(|lesson| lesson.demonstrations.trajectories() > 0) {
        bail!("there are no demonstrations to learn from");
    }
    let taught: Vec<usize> = (0..lessons.len())
        .filter(|&i| lessons[i].demonstrations.trajectories() > 0 && !lessons[i].latents.is_empty())
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut params = Params::default();
    ngf::init(&mut params, &config.ngf, &mut rng)?;
    let network = Ngf::new(&config.ngf, limits)?;
    let mut adam = AdamW::new(params.count(), 1e-4);
    let checkpoint = out.join("policy.checkpoint.safetensors");
    crate::checkpoint::load(&checkpoint, &params, &mut adam)?;

    let mut rng = ChaCha8Rng::seed_from_u64(config.seed ^ (adam.steps + 1) << 20);
    let mut visits: Vec<Visit> = (0..config.batch)
        .map(|i| {
            // Horizons are staggered, so that a batch holds states of every age.
            let mut visit = draw(lessons, &taught, config, &mut rng);
            visit.left = 1 + i % config.horizon;
            visit
        })
        .collect();
    let mut values = params.values()?;
    let mut since = Vec::new();
    while adam.steps < config.steps {
        let batch: Vec<(Visit, std::sync::Mutex<JointVector>)> = visits
            .iter()
            .map(|visit| (*visit, std::sync::Mutex::new(JointVector::zeros())))
            .collect();
        let gradient = sum_over_shards(&batch, config.shards, |part| {
            loss(&network, &params, lessons, config, part)
        })?;
        let rate = schedule(adam.steps, 500, config.steps, config.rate);
        adam.step(&mut values, &gradient.values, rate, 10.0);
        params.set_values(&values)?;
        for (visit, (_, qdd)) in visits.iter_mut().zip(&batch) {
            let qdd = qdd.lock().map(|qdd| *qdd).unwrap_or_default();
            advance(visit, &qdd);
            if visit.left == 0 || !is_near(visit, lessons) {
                *visit = draw(lessons, &taught, config, &mut rng);
            }
        }
        since.push(gradient.loss);
        if adam.steps.is_multiple_of(1000) {
            crate::checkpoint::save(&checkpoint, &params, &adam)?;
        }
        if adam.steps.is_multiple_of(50) {
            let mean = since.iter().sum::<f32>() / since.len() as f32;
            since.clear();
            if !progress(adam.steps, config.steps, mean, &params)? {
                break;
            }
        }
    }
    crate::checkpoint::save(&checkpoint, &params, &adam)?;
    Ok(params)
}

/// A noisy state of a random demonstration, on its way along the nearest one.
fn draw(
    lessons: &[Lesson],
    taught: &[usize],
    config: &DaggerConfig,
    rng: &mut ChaCha8Rng,
) -> Visit {
    let lesson = taught[rng.random_range(0..taught.len())];
    let Lesson { demonstrations, latents } = &lessons[lesson];
    let (first, end) = demonstrations.span(rng.random_range(0..demonstrations.trajectories()));
    let row = rng.random_range(first..end);
    let mut state = demonstrations.state(row);
    let [position, velocity] = config.noise;
    state.q += JointVector::from_fn(|_, _| rng.random_range(-position..=position));
    state.qd += JointVector::from_fn(|_, _| rng.random_range(-velocity..=velocity));
    let (nearest, end) = demonstrations.nearest(&state);
    // Departure: Eq. 1 heads for the next row, but a follower under Eq. 1 stays some rows behind its
    // target. Heading so many rows further makes a drawn state and one under way agree on what to do.
    let ahead = config.gains.lag_rows(CONTROL_PERIOD).max(1);
    let latent = rng.random_range(0..latents.len());
    Visit {
        lesson,
        latent,
        state,
        target: (nearest + ahead).min(end - 1),
        end,
        left: config.horizon,
    }
}

fn advance(visit: &mut Visit, qdd: &JointVector) {
    visit.state = integrator::step(&visit.state, qdd, CONTROL_PERIOD);
    // The last row repeats: the expert learns to stay.
    visit.target = (visit.target + 1).min(visit.end - 1);
    visit.left -= 1;
}

/// Whether the state is still so close to its demonstration that the expert makes sense.
fn is_near(visit: &Visit, lessons: &[Lesson]) -> bool {
    let target = lessons[visit.lesson].demonstrations.state(visit.target);
    let distance = (visit.state.q - target.q).norm();
    distance.is_finite() && distance < 1.0
}

/// Eq. 2: the mean norm of the difference to the expert, and its gradient; leaves the policy's
/// accelerations with the visits.
fn loss(
    network: &Ngf,
    params: &Params,
    lessons: &[Lesson],
    config: &DaggerConfig,
    part: &[(Visit, std::sync::Mutex<JointVector>)],
) -> Result<Gradient> {
    let states: Vec<JointState> = part.iter().map(|(visit, _)| visit.state).collect();
    let z: Vec<&[f32]> =
        part.iter().map(|(v, _)| lessons[v.lesson].latents[v.latent].as_slice()).collect();
    let made = network.accelerations(params, &states, &z)?;
    let wanted: Vec<f32> = part
        .iter()
        .flat_map(|(visit, _)| {
            let target = lessons[visit.lesson].demonstrations.state(visit.target).q;
            let qdd = expert::acceleration(&config.gains, &target, &visit.state);
            qdd.iter().map(|x| *x as f32).collect::<Vec<_>>()
        })
        .collect();
    let wanted = Tensor::from_vec(wanted, (part.len(), DOF), &Device::Cpu)?;
    // The small addend keeps the norm's gradient finite where policy and expert agree.
    let norms = ((&made - wanted)?.sqr()?.sum(1)? + 1e-6)?.sqrt()?;
    let loss = norms.mean_all()?;
    let store = loss.backward()?;
    for ((_, qdd), row) in part.iter().zip(made.to_vec2::<f32>()?) {
        if let Ok(mut qdd) = qdd.lock() {
            *qdd = JointVector::from_fn(|i, _| row[i] as f64);
        }
    }
    Ok(Gradient { loss: loss.to_scalar::<f32>()?, values: params.gradients(&store)? })
}
