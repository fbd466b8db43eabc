//! One attempt, tick by tick: look, approach, policy, lift, hold, verdict (paper §IV).
//!
//! In: an object, a seed, who controls. Out: a verdict and a state hash that are the same natively and
//! in the browser. Knows no files, threads or clocks.

mod approach;
pub mod attempt;
pub mod controller;
pub mod course;
pub mod demonstration;
pub mod episode;
pub mod interval;
pub mod library;
pub mod likeness;
pub mod motion;
mod onlooker;
pub mod phases;
#[cfg(test)]
mod samples;
pub mod tape;
pub mod verdict;
pub mod workcell;

pub use attempt::{Attempt, pose_of_seed};
pub use controller::Controller;
pub use course::{Moment, TermNorms};
pub use demonstration::Demonstration;
pub use episode::Episode;
pub use interval::{wilson95, wilson95_among};
pub use library::Library;
pub use likeness::Likeness;
pub use motion::Motion;
pub use phases::Phase;
pub use tape::Tape;
pub use verdict::{Failure, Verdict};
pub use workcell::{RolloutError, Workcell};
