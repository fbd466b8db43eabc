//! Validation of job parameters, and defaults from presets.

use super::{
    DatasetParams, EncoderParams, EvaluationParams, Invalid, ObjectParams, PolicyParams,
    TrainingParams,
};
use dataset::config::{DatasetConfig, PRESETS};
use imitation::autoencoder::AutoencoderConfig;
use imitation::dagger::DaggerConfig;
use policy::PolicyConfig;
use policy::network::POLICY_NAMES;
use serde_json::Value;

/// Maximum number of optimiser steps of a job.
const MAX_STEPS: u64 = 10_000_000;
/// Maximum number of attempts of an evaluation.
const MAX_ATTEMPTS: u64 = 100_000;
/// Maximum number of threads of a job.
const MAX_THREADS: usize = 256;
/// Maximum batch size.
const MAX_BATCH: usize = 4096;

fn invalid(param: &str, detail: impl Into<String>) -> Invalid {
    Invalid { param: param.into(), detail: detail.into() }
}

/// Error of an unknown preset.
fn unknown_preset() -> Invalid {
    let names = PRESETS.map(|(name, _)| name).join(", ");
    invalid("preset", format!("must be one of {names}"))
}

/// Deserializes parameters; the error names the field that is unknown, missing or of the wrong type.
pub(super) fn parse<T: serde::de::DeserializeOwned>(given: Value) -> Result<T, Invalid> {
    serde_path_to_error::deserialize(given).map_err(|error| {
        let text = error.inner().to_string();
        // Serde quotes the field in backticks; the path names its parent.
        let field = text.split('`').nth(1).unwrap_or_default();
        let path = error.path().to_string();
        let param = if path == "." { field.to_owned() } else { path };
        Invalid { param, detail: text }
    })
}

/// Returns the value if it is in `min..=max`.
fn check_range<T: PartialOrd + Copy + std::fmt::Display>(
    param: &str,
    value: T,
    min: T,
    max: T,
) -> Result<T, Invalid> {
    if (min..=max).contains(&value) {
        return Ok(value);
    }
    Err(invalid(param, format!("must be between {min} and {max}")))
}

impl ObjectParams {
    /// Accepts a built-in object, or a mesh with its mass or density; with `required` false, also no object.
    fn validate(&self, required: bool) -> Result<(), Invalid> {
        let masses = [("mass_kg", self.mass_kg), ("density_kg_m3", self.density_kg_m3)];
        for (param, value) in masses {
            if value.is_some_and(|value| !(value.is_finite() && value > 0.0)) {
                return Err(invalid(param, "must be a positive number"));
            }
            if value.is_some() && self.mesh_id.is_none() {
                return Err(invalid(
                    param,
                    "only valid with mesh_id; built-in objects have a mass",
                ));
            }
        }
        match (&self.object, &self.mesh_id) {
            (Some(_), Some(_)) => {
                Err(invalid("mesh_id", "give either mesh_id or object, not both"))
            }
            (None, None) if required => {
                Err(invalid("object", "give a built-in object, or mesh_id with mass_kg"))
            }
            (None, None) => Ok(()),
            (Some(name), None) if objects::object::Object::from_catalog(name).is_none() => {
                Err(invalid("object", format!("unknown built-in object \"{name}\"")))
            }
            (Some(_), None) => Ok(()),
            (None, Some(_)) if self.mass_kg.is_some() == self.density_kg_m3.is_some() => {
                Err(invalid("mass_kg", "a mesh requires either mass_kg or density_kg_m3"))
            }
            (None, Some(_)) => Ok(()),
        }
    }
}

impl DatasetParams {
    pub(super) fn resolve(self) -> Result<Self, Invalid> {
        if DatasetConfig::preset(&self.preset, self.seed).is_none() {
            return Err(unknown_preset());
        }
        self.object_params.validate(false)?;
        check_range("threads", self.threads, 0, MAX_THREADS)?;
        Ok(self)
    }
}

/// The `f64` with the same shortest decimal form: 0.001 instead of 0.0010000000474974513.
fn shortest_f64(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}

impl EncoderParams {
    pub(super) fn resolve(self) -> Result<Self, Invalid> {
        let default =
            AutoencoderConfig::preset(&self.training.preset).ok_or_else(unknown_preset)?;
        let AutoencoderConfig { steps, batch, learning_rate, checkpoint_every, threads, .. } =
            default;
        let training =
            self.training.resolve(steps, batch, learning_rate, checkpoint_every, threads)?;
        Ok(Self { training, ..self })
    }
}

impl PolicyParams {
    pub(super) fn resolve(self) -> Result<Self, Invalid> {
        let Some(policy) = PolicyConfig::by_name(&self.policy) else {
            return Err(invalid("policy", format!("must be one of {}", POLICY_NAMES.join(", "))));
        };
        let default =
            DaggerConfig::preset(&self.training.preset, policy).ok_or_else(unknown_preset)?;
        let horizon = check_range("horizon", self.horizon.unwrap_or(default.horizon), 1, 1000)?;
        let DaggerConfig { steps, batch, learning_rate, checkpoint_every, threads, .. } = default;
        let training =
            self.training.resolve(steps, batch, learning_rate, checkpoint_every, threads)?;
        Ok(Self { training, horizon: Some(horizon), ..self })
    }
}

impl TrainingParams {
    /// Replaces unspecified values by these defaults and validates the result.
    fn resolve(
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
}

impl EvaluationParams {
    pub(super) fn resolve(self) -> Result<Self, Invalid> {
        self.object_params.validate(true)?;
        check_range("attempts", self.attempts, 1, MAX_ATTEMPTS)?;
        check_range("seed", self.seed, 0, u64::MAX - self.attempts)?;
        Ok(self)
    }
}
