//! Training of a policy.

use super::log::TrainingLog;
use super::settings;
use super::validation::Validation;
use super::{STOPPED, TrainArgs, parse_fraction, parse_norm, parse_positive, reject_same_folder};
use crate::job_client;
use ::policy::PolicyConfig;
use ::policy::model::{CONFIG_FILE, ModelConfig, WEIGHTS_FILE};
use ::policy::networks::{NetworkConfig, POLICY_NAMES};
use anyhow::{Context, Result, bail};
use configs::DaggerConfig;
use dataset::Dataset;
use files::atomic_file;
use imitation::data::demo_group::DemoGroup;
use imitation::data::{demo_group, split};
use imitation::models::encoder::TrainedEncoder;
use imitation::models::export::{model_files, write_files, write_model};
use imitation::nn::Params;
use imitation::train::callback::{TrainingCallback, TrainingStatus};
use imitation::train::dagger;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of `ngf train policy`.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    run: TrainArgs,
    /// Folder of a model whose encoder and policy weights initialize the training
    #[arg(long, value_name = "DIR")]
    init_from: Option<PathBuf>,
    /// Folder of an encoder, or of a model with an encoder, instead of the output folder. Policies with the
    /// same encoder can be compared
    #[arg(long, value_name = "DIR", conflicts_with = "init_from")]
    encoder: Option<PathBuf>,
    /// Folder of a further dataset whose demonstrations are also used; repeatable
    #[arg(long, value_name = "DIR")]
    add_dataset: Vec<PathBuf>,
    /// Policy to train: network and observation
    #[arg(long, value_name = "NAME", default_value = "ngf-pcd", value_parser = POLICY_NAMES)]
    #[arg(conflicts_with = "init_from")]
    policy: String,
    /// Rollout horizon (steps) instead of the default; 1 is behavior cloning
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u16).range(1..=10_000))]
    horizon: Option<u16>,
    /// Fraction of the steps, from the start, in which only F_ψ is trained; 0 trains all subnetworks from the
    /// start
    #[arg(long, value_name = "FRACTION", value_parser = parse_fraction, conflicts_with = "init_from")]
    potential_only_fraction: Option<f64>,
    /// Maximum gradient norm instead of the default; 1e9 disables clipping
    #[arg(long, value_name = "NORM", value_parser = parse_norm, allow_negative_numbers = true)]
    grad_clip: Option<f32>,
    /// Train only on the first poses of each object, up to this number; the held-out poses stay the same
    #[arg(long, value_parser = parse_positive)]
    max_poses: Option<usize>,
    /// Set a hyperparameter, by its path in `training.json` of a trained model; repeatable. For example
    /// policy.network.ngf.position_scale=4
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
}

/// Trains the policy and writes the model.
pub(super) fn train(options: &Options) -> Result<()> {
    let run = &options.run;
    if let Some(from) = &options.init_from {
        reject_same_folder("--init-from", from, &run.out)?;
    }
    let init = options.init_from.as_deref().map(read_model).transpose()?;
    let policy = match &init {
        Some((_, model)) => model.policy.clone(),
        None => PolicyConfig::by_name(&options.policy).context("unknown policy name")?,
    };
    let standard = DaggerConfig::standard(policy);
    let mut config = DaggerConfig { threads: run.threads, seed: run.seed, ..standard };
    config.steps = run.steps.unwrap_or(config.steps);
    config.batch = run.batch.unwrap_or(config.batch);
    config.learning_rate = run.lr.unwrap_or(config.learning_rate);
    config.checkpoint_every =
        run.checkpoint_every.map_or(config.checkpoint_every, |steps| steps as u64);
    config.grad_clip_norm = options.grad_clip.unwrap_or(config.grad_clip_norm);
    config.horizon = options.horizon.map_or(config.horizon, usize::from);
    config.potential_only_fraction =
        options.potential_only_fraction.unwrap_or(config.potential_only_fraction);
    config = settings::apply(&config, &options.settings)?;
    if config.horizon == 1 {
        // Behavior cloning trains only on states of the demonstrations.
        config.start_fraction = 0.0;
    }
    if init.is_some() {
        // The other subnetworks are already trained, so training F_ψ alone would not fit them.
        config.potential_only_fraction = 0.0;
        // The policy can already reach the grasp, so rollouts have their full length from the start.
        config.horizon_ramp = [0.0, 0.0];
    }
    let encoder = match (&init, &options.encoder) {
        (Some((weights, _)), _) => TrainedEncoder::from_model(weights)?,
        (None, Some(folder)) if folder.join("encoder.safetensors").exists() => {
            TrainedEncoder::load(folder)?
        }
        (None, Some(model)) => TrainedEncoder::from_model(&read_model(model)?.0)?,
        (None, None) => TrainedEncoder::load(&run.out)?,
    };
    let is_fabric = matches!(config.policy.network, NetworkConfig::Ngf(_));
    if options.potential_only_fraction.is_some() && !is_fabric {
        bail!("--potential-only-fraction needs a fabric policy, and {} is not one", options.policy);
    }
    let poses = options.max_poses.unwrap_or(usize::MAX);
    let observation = config.policy.observation;
    let folders = std::iter::once(&run.dataset).chain(&options.add_dataset);
    let datasets = folders.map(|folder| Dataset::open(folder)).collect::<Result<Vec<_>>>()?;
    // The process has one worker thread, because matrix products stay on the calling thread.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(run.threads).build()?;
    let split = || split::train_val_split(&datasets, &encoder, observation, poses);
    let (train, held_out) = pool.install(split)?;
    println!("{} demonstration groups for training; {} held out", train.len(), held_out.len());
    if let (NetworkConfig::Ngf(ngf), None) = (&mut config.policy.network, &init) {
        ngf.potential_center = demo_group::mean_configuration(&train);
    }
    let hash = |weights: &Vec<u8>| blake3::hash(weights).to_hex().to_string();
    let record = TrainingRecord {
        config: config.clone(),
        dataset_hash: datasets[0].hash()?,
        added_dataset_hashes: datasets[1..].iter().map(Dataset::hash).collect::<Result<_>>()?,
        encoder_hash: encoder.hash()?,
        max_poses: options.max_poses,
        init_weights_hash: init.as_ref().map(|(weights, _)| hash(weights)),
    };

    let objects: Vec<String> =
        datasets.iter().flat_map(|dataset| dataset.config.objects.iter().cloned()).collect();
    let mut examiner = ValidationCallback {
        config: &config,
        encoder: &encoder,
        groups: [("train", &train), ("held_out", &held_out)],
        validation: Validation::new(&objects, run.threads)?,
        log: TrainingLog::open(&run.out, "policy", "loss (rad/s²)", config.batch)?,
        record: serde_json::to_vec_pretty(&record)?,
        out: &run.out,
    };
    let init = init.as_ref().map(|(weights, _)| weights.as_slice());
    let tree = examiner.validation.tree().clone();
    let trained = dagger::train(&train, &tree, &config, init, &run.out, &mut examiner)?;
    let params = trained.context(STOPPED)?;
    write_model(&run.out, &encoder, &params, &config, &train)
}

/// Training record of a policy, written as `training.json` next to its weights.
#[derive(serde::Serialize)]
struct TrainingRecord {
    #[serde(flatten)]
    config: DaggerConfig,
    /// Hash of the dataset.
    dataset_hash: String,
    /// Hashes of the added datasets.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    added_dataset_hashes: Vec<String>,
    /// Hash of the encoder's weights.
    encoder_hash: String,
    /// Maximum training poses per object, if limited.
    max_poses: Option<usize>,
    /// Hash of the initial weights, if the training was initialized from a model.
    init_weights_hash: Option<String>,
}

/// Training callback that logs, validates the policy at intervals, and writes its model.
struct ValidationCallback<'a> {
    config: &'a DaggerConfig,
    encoder: &'a TrainedEncoder,
    groups: [(&'static str, &'a [DemoGroup]); 2],
    validation: Validation,
    log: TrainingLog,
    /// Contents of `training.json`.
    record: Vec<u8>,
    out: &'a Path,
}

/// Steps between validations.
const VALIDATION_INTERVAL: u64 = 10_000;

impl ValidationCallback<'_> {
    /// Validates the policy (unless this step was validated before), writes its model, and publishes a
    /// checkpoint, each at its own interval.
    fn validate_and_publish(
        &mut self,
        step: u64,
        steps: u64,
        params: &Params,
        is_new: bool,
    ) -> Result<()> {
        let is_last = step == steps;
        // A short training is not validated.
        let validates =
            step.is_multiple_of(VALIDATION_INTERVAL) || is_last && steps > VALIDATION_INTERVAL;
        let publishes = validates || step.is_multiple_of(self.config.checkpoint_every);
        if !publishes && !is_last {
            return Ok(());
        }
        let [(_, train), _] = self.groups;
        let files = model_files(self.encoder, params, self.config, train)?;
        if validates && is_new {
            let start = Instant::now();
            let found = self.validation.run(&self.config.policy, &files, self.groups)?;
            self.log.exclude_time(start.elapsed());
            println!("{found}");
            self.log.write(&json!({ "step": step, "validation": found }))?;
            job_client::log(&format!("step {step}: {found}"));
        }
        write_files(self.out, &files)?;
        // Written together with its weights, because the folder may contain the record of an earlier
        // training.
        atomic_file::write(&self.out.join("training.json"), &self.record)?;
        if publishes {
            let write = |folder: &Path| write_files(folder, &files);
            job_client::checkpoint(self.out, step, write)?;
        }
        Ok(())
    }
}

impl TrainingCallback for ValidationCallback<'_> {
    fn on_progress(&mut self, now: &TrainingStatus) -> Result<bool> {
        self.log.on_progress(now)?;
        self.validate_and_publish(now.step, now.steps, now.params, true)?;
        Ok(true)
    }

    fn on_resume(&mut self, step: u64, steps: u64, params: &Params) -> Result<()> {
        let is_new = !self.log.has("validation", step)?;
        self.validate_and_publish(step, steps, params, is_new)
    }

    fn on_warning(&mut self, text: &str) {
        self.log.on_warning(text);
    }
}

/// Reads weights and configuration of a model.
pub(crate) fn read_model(folder: &Path) -> Result<(Vec<u8>, ModelConfig)> {
    let config = ModelConfig::parse(&read_file(folder, CONFIG_FILE)?)?;
    Ok((read_file(folder, WEIGHTS_FILE)?, config))
}

/// Reads a file of a model.
pub(super) fn read_file(folder: &Path, file: &str) -> Result<Vec<u8>> {
    let path = folder.join(file);
    std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
}
