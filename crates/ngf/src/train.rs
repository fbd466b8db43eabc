//! `ngf train encoder` and `ngf train policy`: training with checkpoints; a killed run continues.

use crate::environment;
use ::policy::model::ModelConfig;
use ::policy::network::{NetworkConfig, POLICIES};
use ::policy::{Network, PolicyConfig};
use anyhow::{Context, Result};
use dataset::Dataset;
use dataset::generate::built_in_object;
use dataset::store;
use geometry::object::Object;
use grasps::Robot;
use imitation::autoencoder::{self, AutoencoderConfig};
use imitation::dagger::{self, DaggerConfig};
use imitation::readout::readout;
use imitation::reconstruction::picture;
use imitation::training::{self, TrainedEncoder};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::Tree;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What to train.
#[derive(clap::Subcommand)]
pub(crate) enum Options {
    /// The autoencoder, on a dataset's clouds.
    Encoder(Run),
    /// The policy, on a dataset's demonstrations, with the encoder in the same folder.
    Policy(PolicyRun),
}

/// Where from, where to, how long.
#[derive(clap::Args)]
pub(crate) struct Run {
    /// Folder of the dataset.
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder of checkpoints and results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Optimiser steps instead of the standard number.
    #[arg(long)]
    steps: Option<u64>,
    /// Threads, one shard of the batch each.
    #[arg(long, default_value_t = 2, value_parser = at_least_one)]
    threads: usize,
    /// Seed of weights and batches.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Batch size instead of the standard one.
    #[arg(long, value_parser = at_least_one)]
    batch: Option<usize>,
    /// Peak learning rate instead of the standard one.
    #[arg(long)]
    rate: Option<f32>,
}

/// What only the policy knows.
#[derive(clap::Args)]
pub(crate) struct PolicyRun {
    #[command(flatten)]
    run: Run,
    /// Folder of a model to continue from instead of beginning anew: its encoder and its policy.
    #[arg(long, value_name = "DIR")]
    from: Option<PathBuf>,
    /// Which policy of those that are compared.
    #[arg(long, value_name = "NAME", default_value = "ngf-pcd", value_parser = POLICIES)]
    #[arg(conflicts_with = "from")]
    policy: String,
    /// Learn from this many poses of each object only.
    #[arg(long, value_parser = at_least_one)]
    poses: Option<usize>,
}

fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("it must be at least 1".into()),
        Ok(number) => Ok(number),
        Err(error) => Err(format!("{error}")),
    }
}

/// Steps between two looks at free roll-outs.
const EVALUATION: u64 = 10_000;

/// Lessons of which these are, spread over all objects.
const SHOWN: usize = 20;

pub(crate) fn run(options: &Options) -> Result<()> {
    if environment::run_again()? {
        return Ok(());
    }
    match options {
        Options::Encoder(run) => encoder(run),
        Options::Policy(run) => policy(run),
    }
}

fn encoder(run: &Run) -> Result<()> {
    let mut config =
        AutoencoderConfig { shards: run.threads, seed: run.seed, ..AutoencoderConfig::standard() };
    config.steps = run.steps.unwrap_or(config.steps);
    config.batch = run.batch.unwrap_or(config.batch);
    config.rate = run.rate.unwrap_or(config.rate);
    let began = Instant::now();
    let dataset = Dataset::open(&run.data)?;
    autoencoder::train(&dataset, &config, &run.out, &mut |step, steps, loss| {
        let rate = step as f64 / began.elapsed().as_secs_f64();
        println!("encoder {step}/{steps}  chamfer {loss:.5}  {rate:.1} steps/s since the start");
    })?;
    examine(&run.out, &dataset.config.encoder_objects)
}

/// Views of an object to which a read-out of the pose is fitted, and on which it is tried.
const VIEWS: usize = 1000;

/// Draws what the autoencoder makes of clouds, and says what a linear read-out of z tells of the pose of each object,
/// and of one that the encoder has not seen.
fn examine(out: &Path, names: &[String]) -> Result<()> {
    let (encoder, robot) = (TrainedEncoder::load(out)?, Robot::standard()?);
    let mut report = serde_json::Map::new();
    let is_variant = |name: &&str| name.contains('.');
    let seen = names.iter().map(String::as_str).filter(|name| !is_variant(name));
    // A mesh of somebody's is no longer at hand.
    let known = |name| Some((name, built_in_object(name).ok()?));
    let objects: Vec<(&str, Object)> = seen.chain(["mustard"]).filter_map(known).collect();
    let picture = picture(&encoder, &robot, &objects, &mut ChaCha8Rng::seed_from_u64(1))?;
    store::write(&out.join("encoder.svg"), picture.as_bytes())?;
    for (name, object) in objects {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let found = readout(&encoder, &robot, &object, VIEWS, &mut rng)?;
        let [median, p90] = found.position.map(|x| 1e3 * x);
        print!("{name}: position off by {median:.1} mm (median), {p90:.1} mm (p90)");
        match found.yaw.map(|yaw| yaw.map(f64::to_degrees)) {
            Some([median, p90]) => println!("; yaw by {median:.1} and {p90:.1} degrees"),
            None => println!("; round"),
        }
        report.insert(name.to_owned(), serde_json::to_value(found)?);
    }
    store::write(&out.join("encoder.report.json"), &serde_json::to_vec_pretty(&report)?)
}

fn policy(options: &PolicyRun) -> Result<()> {
    let run = &options.run;
    let begin = options.from.as_deref().map(read_model).transpose()?;
    let policy = match &begin {
        Some((_, model)) => model.policy.clone(),
        None => PolicyConfig::named(&options.policy).context("its name")?,
    };
    let standard = DaggerConfig::standard(policy);
    let mut config = DaggerConfig { shards: run.threads, seed: run.seed, ..standard };
    config.steps = run.steps.unwrap_or(config.steps);
    config.batch = run.batch.unwrap_or(config.batch);
    config.rate = run.rate.unwrap_or(config.rate);
    let tree = Tree::iiwa7_allegro()?;
    let encoder = match &begin {
        Some((weights, _)) => TrainedEncoder::of_model(weights)?,
        None => TrainedEncoder::load(&run.out)?,
    };
    let poses = options.poses.unwrap_or(usize::MAX);
    let observation = config.policy.observation;
    let (taught, held_out) =
        training::lessons(&Dataset::open(&run.data)?, &encoder, observation, poses)?;
    println!(
        "{} lessons, object poses at a bearing, to learn from; {} held out",
        taught.len(),
        held_out.len()
    );
    if let (NetworkConfig::Ngf(ngf), None) = (&mut config.policy.network, &begin) {
        ngf.rest = training::mean_configuration(&taught);
    }
    store::write(&run.out.join("dagger.json"), &serde_json::to_vec_pretty(&config)?)?;

    let began = Instant::now();
    let mut first = None;
    let mut log = Log::open(&run.out)?;
    let params = dagger::train(
        &taught,
        &tree.limits,
        &config,
        begin.as_ref().map(|(weights, _)| weights.as_slice()),
        &run.out,
        &mut |now| {
            let first = *first.get_or_insert(now.step);
            let rate = (now.step - first) as f64 / began.elapsed().as_secs_f64();
            let left = (now.steps - now.step) as f64 / rate;
            println!(
                "policy {}/{}  loss {:.3} rad/s²  {rate:.2} steps/s  {:.0} min left",
                now.step,
                now.steps,
                now.loss,
                left / 60.0
            );
            log.write(&json!({
                "step": now.step, "loss": now.loss, "gradient_norm": now.gradient,
                "states_per_s": rate * config.batch as f64,
            }))?;
            if now.step % EVALUATION == 0 {
                let (weights, _, _) = training::model_files(&encoder, now.params, &config, &[])?;
                let tensors = ::policy::weights::Tensors::parse(&weights)?;
                let network = Network::load(&tensors, &config.policy, &tree.limits)?;
                for (label, lessons) in [("taught", &taught), ("held_out", &held_out)] {
                    let every = lessons.len().div_ceil(SHOWN).max(1);
                    let shown = lessons.iter().step_by(every);
                    let errors = training::fingertip_errors(&tree, &network, shown);
                    let at = |share: usize| errors.get(errors.len() * share / 10);
                    let (Some(median), Some(p90)) = (at(5), at(9)) else { continue };
                    println!(
                        "  {label}: fingertips off by {:.1} mm (median), {:.1} mm (p90)",
                        1e3 * median,
                        1e3 * p90
                    );
                    log.write(&json!({
                        "step": now.step, "poses": label,
                        "fingertip_error_m": { "median": median, "p90": p90 },
                    }))?;
                }
                training::write_model(&run.out, &encoder, now.params, &config, &taught)?;
            }
            Ok(true)
        },
    )?;
    training::write_model(&run.out, &encoder, &params, &config, &taught)
}

/// What a training says about itself, a line of JSON each.
struct Log(std::fs::File);

impl Log {
    /// Goes on with the log of a folder.
    fn open(out: &Path) -> Result<Self> {
        let path = out.join("policy.log.jsonl");
        let file = std::fs::OpenOptions::new().create(true).append(true).open(&path);
        Ok(Self(file.with_context(|| format!("cannot write {}", path.display()))?))
    }

    fn write(&mut self, line: &serde_json::Value) -> Result<()> {
        Ok(writeln!(self.0, "{line}")?)
    }
}

/// Weights and configuration of a model.
fn read_model(folder: &Path) -> Result<(Vec<u8>, ModelConfig)> {
    let read = |file: &str| {
        let path = folder.join(file);
        std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    Ok((read("weights.safetensors")?, ModelConfig::parse(&read("config.json")?)?))
}
