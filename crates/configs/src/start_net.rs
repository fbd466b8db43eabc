//! Configuration of start network training.

/// Hyperparameters of start network training.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct StartConfig {
    /// Number of optimiser steps.
    pub steps: u64,
    /// Batch size: examples per step.
    pub batch: usize,
    /// Number of threads.
    pub threads: usize,
    /// Peak learning rate.
    pub learning_rate: f32,
    /// Weight (rad/m) of the fingertip term in the loss.
    pub fingertip_weight: f64,
    /// Steps between checkpoints.
    pub checkpoint_every: u64,
    /// Seed of initial weights and batches.
    pub seed: u64,
}

impl StartConfig {
    /// Full-size training: a few minutes on two cores.
    pub fn standard() -> Self {
        Self {
            steps: 20_000,
            batch: 128,
            threads: 2,
            learning_rate: 1e-3,
            fingertip_weight: 3.0,
            checkpoint_every: 1000,
            seed: 0,
        }
    }
}
