//! Supervised training loop: seeded batches, AdamW, and checkpoints from which a run resumes without any
//! difference.

use crate::nn::Params;
use crate::nn::adam::{AdamW, cosine_schedule};
use crate::train::callback::{LossAverager, TrainingCallback, TrainingStatus};
use crate::train::data_parallel::{Gradient, differentiate};
use anyhow::{Result, bail};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use serde_json::Value;
use std::path::Path;

/// Warm-up steps of the learning rate, limited to a tenth of all steps.
const WARMUP_STEPS: u64 = 200;
/// Decoupled weight decay, relative to the learning rate.
const WEIGHT_DECAY: f32 = 1e-4;
/// Max. gradient norm.
const GRAD_CLIP_NORM: f32 = 1.0;

/// Supervised training of a set of parameters on examples.
pub(crate) struct SupervisedTrainer<'a> {
    /// Number of optimiser steps.
    pub(crate) steps: u64,
    /// Batch size: examples per step.
    pub(crate) batch: usize,
    /// Examples per backward pass.
    pub(crate) micro_batch: usize,
    /// Number of threads.
    pub(crate) threads: usize,
    /// Peak learning rate.
    pub(crate) learning_rate: f32,
    /// Steps between checkpoints.
    pub(crate) checkpoint_every: u64,
    /// Seed of the batches.
    pub(crate) seed: u64,
    /// Path of the checkpoint file.
    pub(crate) checkpoint: &'a Path,
    /// Settings that a checkpoint must match to be resumed.
    pub(crate) settings: Value,
}

/// Settings that a checkpoint must match: the configuration, and under `key` the hash of the training data.
/// The number of threads and the checkpoint interval are excluded, because the result does not depend on
/// them.
pub(crate) fn checkpoint_settings(
    config: &impl Serialize,
    key: &str,
    hash: String,
) -> Result<Value> {
    let mut settings = serde_json::to_value(config)?;
    if let Some(settings) = settings.as_object_mut() {
        ["threads", "checkpoint_every"].iter().for_each(|name| drop(settings.remove(*name)));
    }
    settings[key] = hash.into();
    Ok(settings)
}

impl SupervisedTrainer<'_> {
    /// Runs all steps, resuming from the checkpoint if there is one. Returns `false` if the callback stops
    /// the training.
    pub(crate) fn run<T: Sync>(
        &self,
        params: &Params,
        examples: &[T],
        gradient: impl Fn(&[&T]) -> Result<Gradient> + Sync,
        watcher: &mut dyn TrainingCallback,
    ) -> Result<bool> {
        let mut adam = AdamW::new(params, WEIGHT_DECAY);
        crate::train::checkpoint::load(
            self.checkpoint,
            params,
            &mut adam,
            &self.settings,
            &mut |text| watcher.on_warning(text),
        )?;
        let mut reporter = LossAverager::new(self.checkpoint_every);
        while adam.steps < self.steps {
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ (adam.steps + 1) << 20);
            let batch: Vec<&T> =
                (0..self.batch).map(|_| &examples[rng.random_range(0..examples.len())]).collect();
            let gradients = differentiate(&batch, self.micro_batch, self.threads, &gradient)?;
            let rate = cosine_schedule(
                adam.steps,
                WARMUP_STEPS.min(self.steps / 10),
                self.steps,
                self.learning_rate,
            );
            let norm = adam.step(params, &gradients, rate, GRAD_CLIP_NORM, self.threads)?;
            if !norm.is_finite() {
                bail!(
                    "the loss is {} at step {}; reduce the learning rate",
                    gradients.loss(),
                    adam.steps
                );
            }
            if adam.steps.is_multiple_of(self.checkpoint_every) {
                crate::train::checkpoint::save(
                    self.checkpoint,
                    params,
                    &adam,
                    &[],
                    &self.settings,
                )?;
            }
            let (step, steps, loss) = (adam.steps, self.steps, gradients.loss());
            let now = TrainingStatus { step, steps, loss, gradient_norm: norm, params };
            if !reporter.record(watcher, now)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
