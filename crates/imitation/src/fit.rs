//! Fits parameters to examples: seeded batches, AdamW, checkpoints from which a run goes on as if it had not stopped.

use crate::nn::Params;
use crate::nn::adam::{AdamW, schedule};
use crate::shards::{Gradient, differentiate};
use crate::watcher::{Progress, Reporter, Watcher};
use anyhow::{Result, bail};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use serde_json::Value;
use std::path::Path;

/// Steps over which the rate rises to its peak, a tenth of all at most.
const WARMUP: u64 = 200;
/// Decoupled weight decay, in units of the rate.
const DECAY: f32 = 1e-4;
/// Norm to which a gradient is cut.
const CLIP: f32 = 1.0;

/// How long and how fast.
pub(crate) struct Fit<'a> {
    /// Optimiser steps.
    pub(crate) steps: u64,
    /// Examples a step.
    pub(crate) batch: usize,
    /// Examples that are differentiated at once.
    pub(crate) piece: usize,
    /// Threads.
    pub(crate) threads: usize,
    /// Peak learning rate.
    pub(crate) rate: f32,
    /// Steps from checkpoint to checkpoint.
    pub(crate) span: u64,
    /// Seed of the batches.
    pub(crate) seed: u64,
    /// Where checkpoints are kept.
    pub(crate) checkpoint: &'a Path,
    /// What a checkpoint must have been made with.
    pub(crate) settings: Value,
}

/// What a checkpoint must have been made with: a configuration, but for the threads and when checkpoints are written, on
/// which nothing depends, and what is learned from.
pub(crate) fn settings(config: &impl Serialize, from: &str, hash: String) -> Result<Value> {
    let mut settings = serde_json::to_value(config)?;
    if let Some(settings) = settings.as_object_mut() {
        ["threads", "span"].iter().for_each(|name| drop(settings.remove(*name)));
    }
    settings[from] = hash.into();
    Ok(settings)
}

impl Fit<'_> {
    /// Steps until all are done, or the watcher stops it: then `false`.
    pub(crate) fn run<T: Sync>(
        &self,
        params: &Params,
        examples: &[T],
        gradient: impl Fn(&[&T]) -> Result<Gradient> + Sync,
        watcher: &mut dyn Watcher,
    ) -> Result<bool> {
        let mut adam = AdamW::new(params, DECAY);
        crate::checkpoint::load(self.checkpoint, params, &mut adam, &self.settings, &mut |text| {
            watcher.warn(text)
        })?;
        let mut reporter = Reporter::new(self.span);
        while adam.steps < self.steps {
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ (adam.steps + 1) << 20);
            let batch: Vec<&T> =
                (0..self.batch).map(|_| &examples[rng.random_range(0..examples.len())]).collect();
            let gradients = differentiate(&batch, self.piece, self.threads, &gradient)?;
            let rate = schedule(adam.steps, WARMUP.min(self.steps / 10), self.steps, self.rate);
            let norm = adam.step(params, &gradients, rate, CLIP, self.threads)?;
            if !norm.is_finite() {
                bail!("the loss is {} at step {}: lower the rate", gradients.loss(), adam.steps);
            }
            if adam.steps.is_multiple_of(self.span) {
                crate::checkpoint::save(self.checkpoint, params, &adam, &[], &self.settings)?;
            }
            let (step, steps, loss) = (adam.steps, self.steps, gradients.loss());
            let now = Progress { step, steps, loss, gradient: norm, params };
            if !reporter.note(watcher, now)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
