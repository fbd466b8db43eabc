//! Telemetry of an attempt.

use serde::Serialize;

/// Telemetry of one tick.
#[derive(Clone, Copy, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub(crate) struct TelemetrySample {
    /// Half the squared norm of the joint velocities (rad²/s²).
    energy: f64,
    /// Distance of the joint that is nearest to a limit (rad).
    limit_margin: f64,
    /// Maximum damping (1/s); `None` without a fabric.
    damping: Option<f64>,
    /// Norms of the fabric's acceleration terms; `None` without a fabric.
    terms: Option<TermNorms>,
}

/// Norms of the acceleration terms of a fabric (rad/s²).
#[derive(Clone, Copy, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct TermNorms {
    geometry: f64,
    energization: f64,
    potential: f64,
    damping: f64,
}

impl From<rollout::TelemetrySample> for TelemetrySample {
    fn from(sample: rollout::TelemetrySample) -> Self {
        let rollout::TelemetrySample { energy, limit_margin, damping, terms } = sample;
        Self { energy, limit_margin, damping, terms: terms.map(TermNorms::from) }
    }
}

impl From<rollout::TermNorms> for TermNorms {
    fn from(norms: rollout::TermNorms) -> Self {
        let rollout::TermNorms { geometry, energization, potential, damping } = norms;
        Self { geometry, energization, potential, damping }
    }
}
