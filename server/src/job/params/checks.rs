//! What parameters are refused, and what is filled in where they are left open.

use super::{
    Course, DatasetParams, EncoderParams, EvaluationParams, Invalid, PolicyParams, Subject,
};
use dataset::config::{DatasetConfig, PRESETS};
use imitation::autoencoder::AutoencoderConfig;
use imitation::dagger::DaggerConfig;
use policy::PolicyConfig;
use policy::network::POLICIES;
use serde_json::Value;

/// Optimiser steps, attempts and threads that a job may ask for at most.
const MOST_STEPS: u64 = 10_000_000;
const MOST_ATTEMPTS: u64 = 100_000;
const MOST_THREADS: usize = 256;
const MOST_BATCH: usize = 4096;

fn invalid(param: &str, detail: impl Into<String>) -> Invalid {
    Invalid { param: param.into(), detail: detail.into() }
}

/// Refuses a preset that there is not.
fn no_preset() -> Invalid {
    let names = PRESETS.map(|(name, _)| name).join(", ");
    invalid("preset", format!("it must be one of {names}"))
}

/// Reads parameters; a field that is unknown, missing or of the wrong type is named.
pub(super) fn read<T: serde::de::DeserializeOwned>(given: Value) -> Result<T, Invalid> {
    serde_path_to_error::deserialize(given).map_err(|error| {
        let text = error.inner().to_string();
        // Serde names the field in back quotes; the path leads to what has it.
        let field = text.split('`').nth(1).unwrap_or_default();
        let path = error.path().to_string();
        let param = if path == "." { field.to_owned() } else { path };
        Invalid { param, detail: text }
    })
}

fn at_most<T: PartialOrd + Copy + std::fmt::Display>(
    param: &str,
    value: T,
    least: T,
    most: T,
) -> Result<T, Invalid> {
    if (least..=most).contains(&value) {
        return Ok(value);
    }
    Err(invalid(param, format!("it must be from {least} to {most}")))
}

impl Subject {
    /// Refuses what names no object, or more than one, or a mesh without its mass.
    fn checked(&self, must_be: bool) -> Result<(), Invalid> {
        let weights = [("mass_kg", self.mass_kg), ("density_kg_m3", self.density_kg_m3)];
        for (param, weight) in weights {
            if weight.is_some_and(|weight| !(weight.is_finite() && weight > 0.0)) {
                return Err(invalid(param, "it must be a positive number"));
            }
            if weight.is_some() && self.mesh_id.is_none() {
                return Err(invalid(param, "it goes with mesh_id; a built-in object has its own"));
            }
        }
        match (&self.object, &self.mesh_id) {
            (Some(_), Some(_)) => Err(invalid("mesh_id", "give it or object, not both")),
            (None, None) if must_be => {
                Err(invalid("object", "name a built-in object, or give mesh_id with its mass_kg"))
            }
            (None, None) => Ok(()),
            (Some(name), None) if geometry::object::Object::built_in(name).is_none() => {
                Err(invalid("object", format!("there is no built-in object \"{name}\"")))
            }
            (Some(_), None) => Ok(()),
            (None, Some(_)) if self.mass_kg.is_some() == self.density_kg_m3.is_some() => {
                Err(invalid("mass_kg", "a mesh needs mass_kg or density_kg_m3, one of them"))
            }
            (None, Some(_)) => Ok(()),
        }
    }
}

impl DatasetParams {
    pub(super) fn resolved(self) -> Result<Self, Invalid> {
        if DatasetConfig::preset(&self.preset, self.seed).is_none() {
            return Err(no_preset());
        }
        self.subject.checked(false)?;
        at_most("threads", self.threads, 0, MOST_THREADS)?;
        Ok(self)
    }
}

/// The double that is written as this number is: 0.001 and not 0.0010000000474974513.
fn written(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(f64::from(x))
}

impl EncoderParams {
    pub(super) fn resolved(self) -> Result<Self, Invalid> {
        let standard = AutoencoderConfig::preset(&self.course.preset).ok_or_else(no_preset)?;
        let AutoencoderConfig { steps, batch, rate, span, threads, .. } = standard;
        let course = self.course.resolved(steps, batch, rate, span, threads)?;
        Ok(Self { course, ..self })
    }
}

impl PolicyParams {
    pub(super) fn resolved(self) -> Result<Self, Invalid> {
        let Some(policy) = PolicyConfig::named(&self.policy) else {
            return Err(invalid("policy", format!("it must be one of {}", POLICIES.join(", "))));
        };
        let standard = DaggerConfig::preset(&self.course.preset, policy).ok_or_else(no_preset)?;
        let horizon = at_most("horizon", self.horizon.unwrap_or(standard.horizon), 1, 1000)?;
        let DaggerConfig { steps, batch, rate, span, threads, .. } = standard;
        let course = self.course.resolved(steps, batch, rate, span, threads)?;
        Ok(Self { course, horizon: Some(horizon), ..self })
    }
}

impl Course {
    /// What is left open is as here.
    fn resolved(
        self,
        steps: u64,
        batch: usize,
        rate: f32,
        span: u64,
        threads: usize,
    ) -> Result<Self, Invalid> {
        let steps = self.steps.unwrap_or(steps);
        let batch = self.batch.unwrap_or(batch);
        let rate = self.rate.unwrap_or(written(rate));
        let checkpoint = self.checkpoint.unwrap_or(span);
        let threads = if self.threads == 0 { threads } else { self.threads };
        // As it is computed with.
        let single = rate as f32;
        if !(single > 0.0 && single < 1.0) {
            return Err(invalid("rate", "it must be a positive number below 1"));
        }
        Ok(Self {
            preset: self.preset,
            steps: Some(at_most("steps", steps, 1, MOST_STEPS)?),
            batch: Some(at_most("batch", batch, 1, MOST_BATCH)?),
            rate: Some(rate),
            checkpoint: Some(at_most("checkpoint", checkpoint, 1, MOST_STEPS)?),
            threads: at_most("threads", threads, 1, MOST_THREADS)?,
            seed: self.seed,
        })
    }
}

impl EvaluationParams {
    pub(super) fn resolved(self) -> Result<Self, Invalid> {
        self.subject.checked(true)?;
        at_most("attempts", self.attempts, 1, MOST_ATTEMPTS)?;
        at_most("seed", self.seed, 0, u64::MAX - self.attempts)?;
        Ok(self)
    }
}
