//! A policy, with the encoder in the same folder.

use super::{Run, at_least_one};
use ::policy::model::ModelConfig;
use ::policy::network::{NetworkConfig, POLICIES};
use ::policy::weights::Tensors;
use ::policy::{Network, PolicyConfig};
use anyhow::{Context, Result};
use dataset::Dataset;
use dataset::store;
use imitation::dagger::{self, DaggerConfig, Progress};
use imitation::lesson::Lesson;
use imitation::training::{self, TrainedEncoder};
use robot::Tree;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What only the policy knows.
#[derive(clap::Args)]
pub(crate) struct Options {
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

/// Steps between two looks at free roll-outs.
const EVALUATION: u64 = 10_000;

/// Lessons of which these are, spread over all objects.
const SHOWN: usize = 60;

/// Trains it and writes the model.
pub(super) fn train(options: &Options) -> Result<()> {
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

    let log = Log::open(&run.out)?;
    let tree = Tree::iiwa7_allegro()?;
    let limits = tree.limits.clone();
    let (config, taught) = (&config, taught.as_slice());
    let mut school = School {
        config,
        encoder: &encoder,
        lessons: [("taught", taught), ("held_out", held_out.as_slice())],
        tree,
        log,
        began: Instant::now(),
        first: None,
    };
    let begin = begin.as_ref().map(|(weights, _)| weights.as_slice());
    let params = dagger::train(taught, &limits, config, begin, &run.out, &mut |now| {
        school.report(now)?;
        if now.step % EVALUATION == 0 {
            school.examine(now)?;
            training::write_model(&run.out, &encoder, now.params, config, taught)?;
        }
        Ok(true)
    })?;
    training::write_model(&run.out, &encoder, &params, config, taught)
}

/// Looks on while a policy learns.
struct School<'a> {
    config: &'a DaggerConfig,
    encoder: &'a TrainedEncoder,
    lessons: [(&'static str, &'a [Lesson]); 2],
    tree: Tree,
    log: Log,
    began: Instant,
    first: Option<u64>,
}

impl School<'_> {
    /// How far it is, and how fast.
    fn report(&mut self, now: &Progress) -> Result<()> {
        let first = *self.first.get_or_insert(now.step);
        let rate = (now.step - first) as f64 / self.began.elapsed().as_secs_f64();
        let left = (now.steps - now.step) as f64 / rate;
        println!(
            "policy {}/{}  loss {:.3} rad/s²  {rate:.2} steps/s  {:.0} min left",
            now.step,
            now.steps,
            now.loss,
            left / 60.0
        );
        self.log.write(&json!({
            "step": now.step, "loss": now.loss, "gradient_norm": now.gradient,
            "states_per_s": rate * self.config.batch as f64,
        }))
    }

    /// Where free roll-outs end, on poses that are taught and on those that are held out.
    fn examine(&mut self, now: &Progress) -> Result<()> {
        let (weights, _, _) = training::model_files(self.encoder, now.params, self.config, &[])?;
        let (tensors, policy) = (Tensors::parse(&weights)?, &self.config.policy);
        let network = Network::load(&tensors, policy, &self.tree.limits)?;
        for (label, lessons) in self.lessons {
            let every = lessons.len().div_ceil(SHOWN).max(1);
            let shown: Vec<&Lesson> = lessons.iter().step_by(every).collect();
            let errors = training::fingertip_errors(&self.tree, &network, &shown);
            self.say(now.step, label, &errors)?;
        }
        Ok(())
    }

    /// Median and 9 of 10 of the fingertips' sorted errors (m).
    fn say(&mut self, step: u64, poses: &str, errors: &[f64]) -> Result<()> {
        let at = |share: usize| errors.get(errors.len() * share / 10);
        let (Some(median), Some(p90)) = (at(5), at(9)) else { return Ok(()) };
        let [mm, mm90] = [median, p90].map(|x| 1e3 * x);
        println!("  {poses}: fingertips off by {mm:.1} mm (median), {mm90:.1} mm (p90)");
        self.log.write(&json!({
            "step": step, "poses": poses,
            "fingertip_error_m": { "median": median, "p90": p90 },
        }))
    }
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
