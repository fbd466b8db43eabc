//! Progress of a job.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Progress of a phase.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Progress {
    /// Completed units.
    pub completed: f64,
    /// Units of the whole phase.
    pub total: f64,
    /// Unit, e.g. `steps`.
    pub unit: String,
    /// Completed units per second.
    pub rate_per_second: Option<f64>,
}

impl Progress {
    /// Completed fraction of the phase (0..1).
    pub fn fraction(&self) -> f64 {
        if self.total > 0.0 { self.completed / self.total } else { 0.0 }
    }

    /// Estimated time to the end of the phase (s); `None` if the rate is unknown.
    ///
    /// ```rust
    /// use worker_protocol::Progress;
    /// let unit = "steps".to_owned();
    /// let progress = Progress { completed: 250.0, total: 1000.0, unit, rate_per_second: Some(50.0) };
    /// assert_eq!(progress.fraction(), 0.25);
    /// assert_eq!(progress.remaining_seconds(), Some(15.0)); // 750 steps at 50 steps/s
    /// ```
    pub fn remaining_seconds(&self) -> Option<f64> {
        let rate = self.rate_per_second.filter(|rate| *rate > 0.0)?;
        Some((self.total - self.completed).max(0.0) / rate)
    }
}
