//! Grasp attempt, stepped at the control rate: capture, approach, policy, lift, hold, outcome (paper §IV).
//!
//! In: an object, a seed, a controller. Out: an outcome and a state hash, bit-identical natively and in the
//! browser. Independent of files, threads and clocks.

pub mod attempt;
pub mod familiarity;
#[cfg(test)]
mod fixtures;
mod interaction;
pub mod motion_metrics;
pub mod recording;
pub mod rollout_context;
pub mod telemetry;
pub mod wilson_interval;

pub use attempt::{
    Attempt, Controller, DemonstrationLibrary, FailureReason, Outcome, Phase, sample_object_pose,
};
pub use familiarity::Familiarity;
pub use motion_metrics::MotionMetrics;
pub use recording::{AttemptRecording, DemonstrationFile, ReplayFile};
pub use rollout_context::{RolloutContext, RolloutError};
pub use telemetry::{TelemetrySample, TermNorms};
pub use wilson_interval::{clustered_wilson95, wilson95};
