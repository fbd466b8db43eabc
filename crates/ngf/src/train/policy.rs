//! A policy, with the encoder in the same folder.

use super::exam::Exam;
use super::log::Log;
use super::{Run, STOPPED, at_least_one, norm, refuse_same, share};
use crate::report;
use ::policy::PolicyConfig;
use ::policy::model::ModelConfig;
use ::policy::network::{NetworkConfig, POLICIES};
use anyhow::{Context, Result, bail};
use dataset::Dataset;
use dataset::store;
use imitation::dagger::{self, DaggerConfig};
use imitation::encoder::TrainedEncoder;
use imitation::lesson::Lesson;
use imitation::model_files::{model_files, write_files, write_model};
use imitation::nn::Params;
use imitation::watcher::{Progress, Watcher};
use imitation::{lesson, split};
use serde_json::json;
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
    /// Folder of an encoder, or of a model whose encoder is used, instead of the one in the same folder: policies that
    /// are compared see alike.
    #[arg(long, value_name = "DIR", conflicts_with = "from")]
    encoder: Option<PathBuf>,
    /// Which policy of those that are compared.
    #[arg(long, value_name = "NAME", default_value = "ngf-pcd", value_parser = POLICIES)]
    #[arg(conflicts_with = "from")]
    policy: String,
    /// Steps of roll-outs instead of the standard number; 1 is behaviour cloning.
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u16).range(1..=10_000))]
    horizon: Option<u16>,
    /// Share of the steps, the first ones, that train a fabric's potential alone, instead of the standard one; 0 trains
    /// all its networks from the beginning.
    #[arg(long, value_name = "SHARE", value_parser = share, conflicts_with = "from")]
    potential_share: Option<f64>,
    /// Norm to which a gradient is cut, instead of the standard one; 1e9 cuts none.
    #[arg(long, value_name = "NORM", value_parser = norm, allow_negative_numbers = true)]
    clip: Option<f32>,
    /// Learn from the first so many poses of each object only; the same ones are held out.
    #[arg(long, value_parser = at_least_one)]
    poses: Option<usize>,
}

/// Trains it and writes the model.
pub(super) fn train(options: &Options) -> Result<()> {
    let run = &options.run;
    if let Some(from) = &options.from {
        refuse_same(from, &run.out)?;
    }
    let begin = options.from.as_deref().map(read_model).transpose()?;
    let policy = match &begin {
        Some((_, model)) => model.policy.clone(),
        None => PolicyConfig::named(&options.policy).context("its name")?,
    };
    let standard = DaggerConfig::standard(policy);
    let mut config = DaggerConfig { threads: run.threads, seed: run.seed, ..standard };
    config.steps = run.steps.unwrap_or(config.steps);
    config.batch = run.batch.unwrap_or(config.batch);
    config.rate = run.rate.unwrap_or(config.rate);
    config.span = run.checkpoint.map_or(config.span, |steps| steps as u64);
    config.clip = options.clip.unwrap_or(config.clip);
    config.horizon = options.horizon.map_or(config.horizon, usize::from);
    config.potential_share = options.potential_share.unwrap_or(config.potential_share);
    if config.horizon == 1 {
        // Behaviour cloning knows the demonstrations' own states.
        config.start_share = 0.0;
    }
    if begin.is_some() {
        // Its other networks have learned what F_ψ would not know of.
        config.potential_share = 0.0;
        // And it knows where to go: roll-outs have their full length from the beginning.
        config.growth = [0.0, 0.0];
    }
    let encoder = match (&begin, &options.encoder) {
        (Some((weights, _)), _) => TrainedEncoder::of_model(weights)?,
        (None, Some(folder)) if folder.join("encoder.safetensors").exists() => {
            TrainedEncoder::load(folder)?
        }
        (None, Some(model)) => TrainedEncoder::of_model(&read_model(model)?.0)?,
        (None, None) => TrainedEncoder::load(&run.out)?,
    };
    let is_fabric = matches!(config.policy.network, NetworkConfig::Ngf(_));
    if options.potential_share.is_some() && !is_fabric {
        bail!("--potential-share is of a fabric's networks, and {} is none", options.policy);
    }
    let poses = options.poses.unwrap_or(usize::MAX);
    let observation = config.policy.observation;
    let dataset = Dataset::open(&run.data)?;
    let (taught, held_out) = split::lessons(&dataset, &encoder, observation, poses)?;
    println!(
        "{} lessons, object poses at a bearing, to learn from; {} held out",
        taught.len(),
        held_out.len()
    );
    if let (NetworkConfig::Ngf(ngf), None) = (&mut config.policy.network, &begin) {
        ngf.rest = lesson::mean_configuration(&taught);
    }
    let hash = |weights: &Vec<u8>| blake3::hash(weights).to_hex().to_string();
    let about = About {
        config: config.clone(),
        data: dataset.hash()?,
        encoder: encoder.hash()?,
        poses: options.poses,
        from: begin.as_ref().map(|(weights, _)| hash(weights)),
    };

    let mut examiner = Examiner {
        config: &config,
        encoder: &encoder,
        lessons: [("taught", &taught), ("held_out", &held_out)],
        exam: Exam::new(&dataset.config.objects, run.threads)?,
        log: Log::open(&run.out, "policy", "loss (rad/s²)", config.batch)?,
        about: serde_json::to_vec_pretty(&about)?,
        out: &run.out,
    };
    let begin = begin.as_ref().map(|(weights, _)| weights.as_slice());
    let tree = examiner.exam.tree().clone();
    let trained = dagger::train(&taught, &tree, &config, begin, &run.out, &mut examiner)?;
    let params = trained.context(STOPPED)?;
    write_model(&run.out, &encoder, &params, &config, &taught)
}

/// What a policy was made of.
#[derive(serde::Serialize)]
struct About {
    #[serde(flatten)]
    config: DaggerConfig,
    /// Hash of the dataset.
    data: String,
    /// Hash of the encoder's weights.
    encoder: String,
    /// Poses of each object that it learned from, if not all.
    poses: Option<usize>,
    /// Hash of the weights that it began with, if not anew.
    from: Option<String>,
}

/// Looks on while a policy learns, and examines it now and then.
struct Examiner<'a> {
    config: &'a DaggerConfig,
    encoder: &'a TrainedEncoder,
    lessons: [(&'static str, &'a [Lesson]); 2],
    exam: Exam,
    log: Log,
    /// How it is trained, and on what.
    about: Vec<u8>,
    out: &'a Path,
}

/// Steps between two examinations.
const EXAMINATION: u64 = 10_000;

impl Examiner<'_> {
    /// Examines the policy unless that was done before, writes its model and offers it, each where it is due.
    fn examine(&mut self, step: u64, steps: u64, params: &Params, is_new: bool) -> Result<()> {
        let is_last = step == steps;
        // One that was trained for a moment is not worth it.
        let is_examined = step.is_multiple_of(EXAMINATION) || is_last && steps > EXAMINATION;
        let is_offered = is_examined || step.is_multiple_of(self.config.span);
        if !is_offered && !is_last {
            return Ok(());
        }
        let [(_, taught), _] = self.lessons;
        let files = model_files(self.encoder, params, self.config, taught)?;
        if is_examined && is_new {
            let began = Instant::now();
            let found = self.exam.take(&self.config.policy, &files, self.lessons)?;
            self.log.leave_out(began.elapsed());
            println!("{found}");
            self.log.write(&json!({ "step": step, "exam": found }))?;
            report::say(&format!("step {step}: {found}"));
        }
        write_files(self.out, &files)?;
        // Beside the weights that it made; other ones may have been here before.
        store::write(&self.out.join("dagger.json"), &self.about)?;
        if is_offered {
            let write = |folder: &Path| write_files(folder, &files);
            report::checkpoint(self.out, step, write)?;
        }
        Ok(())
    }
}

impl Watcher for Examiner<'_> {
    fn progress(&mut self, now: &Progress) -> Result<bool> {
        self.log.progress(now)?;
        self.examine(now.step, now.steps, now.params, true)?;
        Ok(true)
    }

    fn resumed(&mut self, step: u64, steps: u64, params: &Params) -> Result<()> {
        let is_new = !self.log.has("exam", step)?;
        self.examine(step, steps, params, is_new)
    }

    fn warn(&mut self, text: &str) {
        self.log.warn(text);
    }
}

/// Weights and configuration of a model.
pub(crate) fn read_model(folder: &Path) -> Result<(Vec<u8>, ModelConfig)> {
    let config = ModelConfig::parse(&read_file(folder, "config.json")?)?;
    Ok((read_file(folder, "weights.safetensors")?, config))
}

/// A file of a model.
pub(super) fn read_file(folder: &Path, file: &str) -> Result<Vec<u8>> {
    let path = folder.join(file);
    std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
}
