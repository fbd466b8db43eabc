//! Grasp attempt, stepped at the control rate of 30 Hz (paper §IV).
//!
//! 1. Capture: a depth image gives the point cloud, with the arm in its home posture.
//! 2. Approach: a spline leads from home to the start configuration, with the open hand above the object.
//! 3. Policy: the controller moves arm and hand until they rest, or for 4 s.
//! 4. Lift: a planner raises the palm by 15 cm; the commanded finger joints stay fixed.
//! 5. Hold: the object has to stay in the hand for 2 s. The attempt ends with an outcome.
//!
//! In: a [`RolloutContext`] (robot, sensor, model), an object, a seed, a [`Controller`]. Out: an [`Outcome`]
//! and a state hash, bit-identical natively and in the browser. Independent of files, threads and clocks.
//!
//! Start with [`Attempt`]. A control period lasts 1/30 s; ticks count the control periods. The commanded state
//! is the joint state that the motors follow.

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
    Attempt, Controller, DemonstrationLibrary, Evidence, FailureReason, Lockstep, Outcome, Phase,
    Slip, policy_ends, sample_object_pose,
};
pub use familiarity::Familiarity;
pub use motion_metrics::MotionMetrics;
pub use recording::{AttemptRecording, DemonstrationFile, ReplayFile};
pub use rollout_context::{RolloutContext, RolloutError};
pub use telemetry::{TelemetrySample, TermNorms};
pub use wilson_interval::{clustered_wilson95, wilson95};
