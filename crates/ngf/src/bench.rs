//! `ngf bench`: milliseconds of what runs in an attempt, on this machine.

use crate::engine;
use anyhow::{Context, Result};
use dataset::store;
use geometry::object::Object;
use imitation::nn::{Params, autoencoder, ngf};
use imitation::spread::median;
use policy::ngf::NgfConfig;
use policy::weights::Tensors;
use policy::{Encoder, LATENT, Ngf, Whitening};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rollout::{Attempt, Controller, Phase, Workcell};
use scene::{Scene, Simulation};
use std::path::PathBuf;
use std::time::Instant;

/// Where the rows go.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Also write the rows to this file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Print nothing.
    #[arg(long)]
    quiet: bool,
    /// Measure the steps of training instead, on two threads.
    #[arg(long)]
    pub(crate) learning: bool,
}

/// One measurement: the median over its repeats.
#[derive(serde::Serialize)]
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) value: f64,
    pub(crate) unit: &'static str,
}

/// Measures, prints and writes. Weights are random: their values do not change the time.
pub(crate) fn run(options: &Options) -> Result<()> {
    let rows = if options.learning { learning()? } else { acting()? };
    for row in rows.iter().filter(|_| !options.quiet) {
        println!("{:32} {:8.3} {}", row.name, row.value, row.unit);
    }
    match &options.json {
        Some(path) => store::write(path, &serde_json::to_vec_pretty(&rows)?),
        None => Ok(()),
    }
}

/// Steps of training.
fn learning() -> Result<Vec<Row>> {
    let rows = imitation::benchmark::rows()?;
    Ok(rows.into_iter().map(|(name, value)| Row { name, value, unit: "ms" }).collect())
}

/// What runs in an attempt, and what makes data.
fn acting() -> Result<Vec<Row>> {
    let workcell = Workcell::new()?;
    let robot = &workcell.robot;
    let object = Object::built_in("sugar_box").context("the sugar box")?;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut params = Params::default();
    let config = NgfConfig::paper();
    ngf::init(&mut params, &config, &mut rng)?;
    autoencoder::init(&mut params, &mut rng)?;
    let bytes = params.export(&Whitening::identity().tensors())?;
    let tensors = Tensors::parse(&bytes)?;
    let policy = Ngf::load(&tensors, &config, LATENT, &robot.tree.limits)?;
    let encoder = Encoder::load(&tensors)?;

    let pose = robot.config.upright(0.6, 0.0, 0.4);
    let cloud = workcell.eye.cloud(&workcell.eye.frame(&object.mesh, &pose, &mut rng));
    let z = encoder.encode(&cloud).context("a cloud")?.z;
    let state = robot::JointState::at_rest(robot.nominal);
    let mut rows = vec![
        row("policy_step_native", 200, || {
            std::hint::black_box(policy.acceleration(&state, &z));
        }),
        row("encode_native", 20, || {
            std::hint::black_box(encoder.encode(&cloud));
        }),
        row("depth_frame_native", 10, || {
            workcell.eye.frame(&object.mesh, &pose, &mut rng);
        }),
    ];
    let mut ticks = Vec::new();
    let mut attempt =
        Attempt::begin(&workcell, &object, "sugar_box", None, 0, Controller::Planner)?;
    while attempt.verdict().is_none() {
        let begin = Instant::now();
        attempt.tick(&workcell);
        if attempt.phase() == Phase::Hold {
            ticks.push(begin.elapsed().as_secs_f64() * 1e3);
        }
    }
    rows.push(Row { name: "physics_tick_in_contact_native", value: middle(ticks), unit: "ms" });
    let home = robot::JointState::at_rest(robot.config.home());
    let mut scene = Scene::new(&robot.config, &robot.tree, &object, &pose, &home.q)?;
    let mut step = row("physics_step_home", 200, || scene.follow(&home, &home));
    step.value /= robot.config.physics.substeps as f64;
    rows.push(step);
    rows.extend(engine::rows(robot)?);
    Ok(rows)
}

fn middle(values: Vec<f64>) -> f64 {
    median(values).unwrap_or(f64::NAN)
}

fn row(name: &'static str, repeats: usize, mut work: impl FnMut()) -> Row {
    let time = |_| {
        let begin = Instant::now();
        work();
        begin.elapsed().as_secs_f64() * 1e3
    };
    Row { name, value: middle((0..repeats).map(time).collect()), unit: "ms" }
}
