//! `ngf bench`: time (ms) of the components of an attempt, on this machine.

use crate::{datagen_bench, physics_bench};
use anyhow::{Context, Result};
use evaluation::percentiles::median;
use files::atomic_file;
use imitation::nn::Params;
use imitation::nn::networks::{autoencoder, ngf};
use objects::object::Object;
use policy::networks::ngf::NgfConfig;
use policy::weights::Tensors;
use policy::{Encoder, LATENT_DIM, NetworkInput, Ngf, Whitening};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rollout::RolloutContext;
use std::path::PathBuf;
use std::time::Instant;

/// Selection and output of the benchmark.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Also write the rows to this JSON file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Do not print the rows
    #[arg(long)]
    quiet: bool,
    /// Measure training steps instead, on two threads
    #[arg(long, conflicts_with = "physics")]
    pub(crate) training: bool,
    /// Measure only the physics
    #[arg(long)]
    physics: bool,
    /// Also write the state in which the hand holds the box to this JSON file
    #[arg(long, value_name = "FILE", conflicts_with = "training")]
    state: Option<PathBuf>,
}

/// One measurement: the median over its repeats.
#[derive(serde::Serialize)]
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) value: f64,
    pub(crate) unit: &'static str,
}

/// Measures, prints and writes the rows. Weights are random; their values do not affect the time.
pub(crate) fn run(options: &Options) -> Result<()> {
    let rows = if options.training { training_rows()? } else { attempt_rows(options)? };
    for row in rows.iter().filter(|_| !options.quiet) {
        println!("{:32} {:8.3} {}", row.name, row.value, row.unit);
    }
    match &options.json {
        Some(path) => atomic_file::write(path, &serde_json::to_vec_pretty(&rows)?),
        None => Ok(()),
    }
}

/// Rows of training steps.
fn training_rows() -> Result<Vec<Row>> {
    let rows = imitation::benchmark::rows()?;
    Ok(rows.into_iter().map(|(name, value)| Row { name, value, unit: "ms" }).collect())
}

/// Rows of the components of an attempt, and of data generation.
fn attempt_rows(options: &Options) -> Result<Vec<Row>> {
    let context = RolloutContext::new()?;
    let robot = &context.robot;
    let name = "sugar_box";
    let object = Object::from_catalog(name).context("the sugar box is missing")?;
    let physics = physics_bench::rows(&context, &object, name, options.state.as_deref())?;
    if options.physics {
        return Ok(physics);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut params = Params::default();
    let config = NgfConfig::paper();
    ngf::init(&mut params, &config, &mut rng)?;
    autoencoder::init(&mut params, &mut rng)?;
    let bytes = params.export(&Whitening::identity().tensors())?;
    let tensors = Tensors::parse(&bytes)?;
    let policy = Ngf::load(&tensors, &config, LATENT_DIM, &robot.tree)?;
    let encoder = Encoder::load(&tensors)?;

    let pose = robot.config.object_pose(0.6, 0.0, 0.4);
    let cloud =
        context.sensor.extract_cloud(&context.sensor.capture(&object.mesh, &pose, &mut rng));
    let z = encoder.encode(&cloud).context("cannot encode the cloud")?.latent;
    let state = robot::JointState::at_rest(robot.nominal);
    let inputs = [NetworkInput::new(state, &z); 8];
    let mut rows = vec![
        measure("policy_step_native", 200, || {
            std::hint::black_box(policy.accelerations(&inputs[..1]));
        }),
        measure("policy_step_8_native", 50, || {
            std::hint::black_box(policy.accelerations(&inputs));
        }),
        measure("encode_native", 20, || {
            std::hint::black_box(encoder.encode(&cloud));
        }),
        measure("depth_frame_native", 10, || {
            context.sensor.capture(&object.mesh, &pose, &mut rng);
        }),
    ];
    rows.extend(physics);
    rows.extend(datagen_bench::rows(robot)?);
    Ok(rows)
}

pub(crate) fn median_or_nan(values: Vec<f64>) -> f64 {
    median(values).unwrap_or(f64::NAN)
}

pub(crate) fn measure(name: &'static str, repeats: usize, mut work: impl FnMut()) -> Row {
    let time = |_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64() * 1e3
    };
    Row { name, value: median_or_nan((0..repeats).map(time).collect()), unit: "ms" }
}
