//! The paper's comparison (§IV): all policies on all objects with the same seeds, with tables, plots and
//! tests.

mod markdown;
mod paired_test;
mod success_chart;
mod telemetry_plots;

pub use markdown::markdown_report;
pub use paired_test::{PairedTest, paired_test};
pub use success_chart::success_chart;
pub use telemetry_plots::{AttemptTelemetry, telemetry_plots};

use crate::EvaluationReport;

/// Evaluation reports of a comparison, ordered by policy, then by object.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Comparison {
    /// One report per pair of policy (or control) and object.
    pub reports: Vec<EvaluationReport>,
}

impl Comparison {
    /// Distinct policy labels, in order of first appearance.
    pub fn policies(&self) -> Vec<&str> {
        unique(self.reports.iter().map(|report| report.policy.as_str()))
    }

    /// Distinct object names, in order of first appearance.
    pub fn objects(&self) -> Vec<&str> {
        unique(self.reports.iter().map(|report| report.object.as_str()))
    }

    /// The report of `policy` on `object`, if that pair was evaluated.
    pub fn report(&self, policy: &str, object: &str) -> Option<&EvaluationReport> {
        self.reports.iter().find(|report| report.policy == policy && report.object == object)
    }
}

fn unique<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut unique = Vec::new();
    for name in names {
        if !unique.contains(&name) {
            unique.push(name);
        }
    }
    unique
}

#[cfg(test)]
pub(crate) mod fixtures {
    use super::*;
    use crate::AttemptResult;
    use rollout::{FailureReason, Outcome, wilson95};
    use std::collections::BTreeMap;

    /// A report with one attempt per entry of `lifts`, from seed 0: lifted if true, else missed.
    pub(crate) fn report(policy: &str, object: &str, lifts: &[bool]) -> EvaluationReport {
        let row = |(seed, lifts): (usize, &bool)| AttemptResult {
            seed: seed as u64,
            pose: [0.6, 0.0, 0.0],
            outcome: match lifts {
                true => Outcome::Lifted { slip: 0.0 },
                false => Outcome::Failed { reason: FailureReason::Missed },
            },
            final_state_hash: String::new(),
            motion: None,
            clearance: None,
            familiarity: None,
            object_from_palm: None,
        };
        let lifted = lifts.iter().filter(|lifts| **lifts).count();
        EvaluationReport {
            policy: policy.into(),
            object: object.into(),
            attempts: lifts.len(),
            lifted,
            wilson95: wilson95(lifted, lifts.len()),
            failures: BTreeMap::from([("missed".into(), lifts.len() - lifted)]),
            seed: 0,
            scene_hash: "scene".into(),
            object_hash: object.into(),
            orientation: None,
            model_hash: None,
            rows: lifts.iter().enumerate().map(row).collect(),
        }
    }
}
