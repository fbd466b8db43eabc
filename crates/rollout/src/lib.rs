//! Grasp attempt, stepped at the control rate: capture, approach, policy, lift, hold, outcome (paper §IV).
//!
//! In: an object, a seed, a controller. Out: an outcome and a state hash, bit-identical natively and in the
//! browser. Independent of files, threads and clocks.

mod approach;
pub mod attempt;
pub mod confidence;
pub mod controller;
pub mod demonstration_file;
pub mod demonstration_library;
pub mod familiarity;
#[cfg(test)]
mod fixtures;
mod interaction;
pub mod motion_metrics;
pub mod outcome;
pub mod phases;
pub mod recording;
pub mod replay_file;
pub mod rollout_context;
pub mod telemetry;

pub use attempt::{Attempt, sample_object_pose};
pub use confidence::{clustered_wilson95, wilson95};
pub use controller::Controller;
pub use demonstration_file::DemonstrationFile;
pub use demonstration_library::DemonstrationLibrary;
pub use familiarity::Familiarity;
pub use motion_metrics::MotionMetrics;
pub use outcome::{FailureReason, Outcome};
pub use phases::Phase;
pub use recording::AttemptRecording;
pub use replay_file::ReplayFile;
pub use rollout_context::{RolloutContext, RolloutError};
pub use telemetry::{TelemetrySample, TermNorms};
