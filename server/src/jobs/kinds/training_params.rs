//! Parameters common to all training jobs: defaults, validation and command line.

use super::command_line::option_args;
use super::param_checks::{Invalid, MAX_THREADS, check_range, invalid, string_enum};
use configs::dataset::PRESETS;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa::openapi::schema::Schema;

/// Maximum number of optimiser steps of a job.
const MAX_STEPS: u64 = 10_000_000;
/// Maximum batch size.
const MAX_BATCH: usize = 4096;

/// Disk space of a model with its training checkpoint (bytes).
pub(super) const MODEL_BYTES: f64 = 150e6;

/// Parameters common to all training jobs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct TrainingParams {
    /// Preset that supplies steps, batch size, learning rate and checkpoint interval where they are not
    /// given.
    #[serde(default = "default_preset")]
    #[schema(schema_with = presets)]
    pub(crate) preset: String,
    /// Number of optimiser steps.
    #[serde(default)]
    pub(crate) steps: Option<u64>,
    /// Batch size.
    #[serde(default)]
    pub(crate) batch: Option<usize>,
    /// Peak learning rate.
    #[serde(default)]
    pub(crate) learning_rate: Option<f64>,
    /// Checkpoint interval (steps).
    #[serde(default)]
    pub(crate) checkpoint_every: Option<u64>,
    /// Threads; 0 = the default number.
    #[serde(default)]
    pub(crate) threads: usize,
    /// Random seed of initial weights and batches.
    #[serde(default)]
    pub(crate) seed: u64,
}

fn default_preset() -> String {
    "paper".into()
}

/// Training presets; the names are those of the dataset presets.
fn presets() -> Schema {
    let text = "Preset that supplies steps, batch size, learning rate and checkpoint interval where they are \
        not given.";
    string_enum(PRESETS.map(|(name, _)| name))
        .default(Some(default_preset().into()))
        .description(Some(text))
        .into()
}

/// The `f64` with the same shortest decimal form: 0.001 instead of 0.0010000000474974513.
fn shortest_f64(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}

impl TrainingParams {
    /// Replaces unspecified values by these defaults and validates the result.
    pub(super) fn resolve(
        self,
        steps: u64,
        batch: usize,
        learning_rate: f32,
        checkpoint_every: u64,
        threads: usize,
    ) -> Result<Self, Invalid> {
        let steps = self.steps.unwrap_or(steps);
        let batch = self.batch.unwrap_or(batch);
        let learning_rate = self.learning_rate.unwrap_or(shortest_f64(learning_rate));
        let checkpoint_every = self.checkpoint_every.unwrap_or(checkpoint_every);
        let threads = if self.threads == 0 { threads } else { self.threads };
        // Checked in the precision of the optimiser.
        let single = learning_rate as f32;
        if !(single > 0.0 && single < 1.0) {
            return Err(invalid("learning_rate", "must be greater than 0 and less than 1"));
        }
        Ok(Self {
            preset: self.preset,
            steps: Some(check_range("steps", steps, 1, MAX_STEPS)?),
            batch: Some(check_range("batch", batch, 1, MAX_BATCH)?),
            learning_rate: Some(learning_rate),
            checkpoint_every: Some(check_range(
                "checkpoint_every",
                checkpoint_every,
                1,
                MAX_STEPS,
            )?),
            threads: check_range("threads", threads, 1, MAX_THREADS)?,
            seed: self.seed,
        })
    }

    /// Options of a training command.
    pub(super) fn argv(&self) -> Vec<String> {
        [
            option_args("steps", self.steps),
            option_args("batch", self.batch),
            option_args("lr", self.learning_rate),
            option_args("checkpoint-every", self.checkpoint_every),
            option_args("threads", Some(self.threads)),
            option_args("seed", Some(self.seed)),
        ]
        .concat()
    }

    /// Number of training examples: steps times batch size.
    pub(super) fn num_examples(&self) -> f64 {
        self.steps.unwrap_or_default() as f64 * self.batch.unwrap_or_default() as f64
    }
}
