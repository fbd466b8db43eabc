//! Evaluation: attempts of one controller with their statistics, and the paper's comparison (§IV).
//!
//! In: a rollout context with or without a model, objects, seeds. Out: reports, tables, charts. Needs no
//! tensor library, so the planner is evaluated without one.

pub mod comparison;
mod evaluate;
pub mod percentiles;

pub use evaluate::{AttemptResult, EvaluationReport, evaluate};
