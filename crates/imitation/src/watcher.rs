//! Who looks on while something is trained.

use crate::nn::Params;
use anyhow::Result;

/// How far a training is.
pub struct Progress<'a> {
    /// Optimiser steps done.
    pub step: u64,
    /// Optimiser steps to do.
    pub steps: u64,
    /// Mean loss since the last call: of a policy in rad/s², of a start network in rad, of the autoencoder its Chamfer
    /// distance, in squares of [`policy::encoder::WORKSPACE_SCALE`].
    pub loss: f32,
    /// Norm of the last gradient.
    pub gradient: f32,
    /// The parameters now.
    pub params: &'a Params,
}

/// Is told how a training goes.
pub trait Watcher {
    /// Called every 50 steps, where a checkpoint is due, and after the last step. `false` stops the training: what came
    /// after the last checkpoint is done again when it is resumed.
    fn progress(&mut self, now: &Progress) -> Result<bool>;

    /// Called where a training goes on from a checkpoint: what was to follow the checkpoint may have been cut short.
    fn resumed(&mut self, _step: u64, _steps: u64, _params: &Params) -> Result<()> {
        Ok(())
    }

    /// Something went wrong that does not end the training.
    fn warn(&mut self, _text: &str) {}
}

impl<F: FnMut(&Progress) -> Result<bool>> Watcher for F {
    fn progress(&mut self, now: &Progress) -> Result<bool> {
        self(now)
    }
}

/// Averages the loss between two reports.
pub(crate) struct Reporter {
    since: Vec<f32>,
    span: u64,
}

/// Steps from report to report.
const INTERVAL: u64 = 50;

impl Reporter {
    /// Reports where a checkpoint is due, too: every `span` steps.
    pub(crate) fn new(span: u64) -> Self {
        Self { since: Vec::new(), span }
    }

    /// Notes the loss of a step, and reports where that is due; `false` is passed on.
    pub(crate) fn note(&mut self, watcher: &mut dyn Watcher, now: Progress) -> Result<bool> {
        self.since.push(now.loss);
        let is_due = now.step.is_multiple_of(INTERVAL) || now.step.is_multiple_of(self.span);
        if !is_due && now.step != now.steps {
            return Ok(true);
        }
        let loss = self.since.iter().sum::<f32>() / self.since.len() as f32;
        self.since.clear();
        watcher.progress(&Progress { loss, ..now })
    }
}
