//! Training callbacks.

use crate::nn::Params;
use anyhow::Result;

/// Status that a training loop reports to its callback.
pub struct TrainingStatus<'a> {
    /// Optimiser steps completed.
    pub step: u64,
    /// Total number of optimiser steps.
    pub steps: u64,
    /// Mean loss since the last call. Policy: rad/s². Start network: rad. Autoencoder: Chamfer distance, in
    /// units of [`policy::encoder::WORKSPACE_SCALE`] squared.
    pub loss: f32,
    /// Norm of the last gradient, before clipping.
    pub gradient_norm: f32,
    /// Current parameters.
    pub params: &'a Params,
}

/// Receives the status of a training run and can stop it.
pub trait TrainingCallback {
    /// Called every 50 steps, at each checkpoint, and after the last step. `false` stops the training. Steps
    /// after the last checkpoint are repeated on resume.
    fn on_progress(&mut self, now: &TrainingStatus) -> Result<bool>;

    /// Called on resume from a checkpoint. The callback of that checkpoint may not have completed.
    fn on_resume(&mut self, _step: u64, _steps: u64, _params: &Params) -> Result<()> {
        Ok(())
    }

    /// Receives a warning about a problem that does not end the training.
    fn on_warning(&mut self, _text: &str) {}
}

impl<F: FnMut(&TrainingStatus) -> Result<bool>> TrainingCallback for F {
    fn on_progress(&mut self, now: &TrainingStatus) -> Result<bool> {
        self(now)
    }
}

/// Averages the loss between two reports.
pub(crate) struct LossAverager {
    losses: Vec<f32>,
    checkpoint_every: u64,
}

/// Steps between reports.
const REPORT_INTERVAL: u64 = 50;

impl LossAverager {
    /// Also reports at each checkpoint, every `span` steps.
    pub(crate) fn new(span: u64) -> Self {
        Self { losses: Vec::new(), checkpoint_every: span }
    }

    /// Records the loss of a step and calls the callback when a report is due. Returns the callback's answer,
    /// else `true`.
    pub(crate) fn record(
        &mut self,
        watcher: &mut dyn TrainingCallback,
        now: TrainingStatus,
    ) -> Result<bool> {
        self.losses.push(now.loss);
        let is_due = now.step.is_multiple_of(REPORT_INTERVAL)
            || now.step.is_multiple_of(self.checkpoint_every);
        if !is_due && now.step != now.steps {
            return Ok(true);
        }
        let loss = self.losses.iter().sum::<f32>() / self.losses.len() as f32;
        self.losses.clear();
        watcher.on_progress(&TrainingStatus { loss, ..now })
    }
}
