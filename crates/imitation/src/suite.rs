//! The paper's experiment (§IV): every policy on every object, from the same seeds, and what follows from the counts.

mod compare;
mod courses;
mod figure;
mod table;

pub use compare::{Paired, paired};
pub use courses::{Course, courses};
pub use figure::figure;
pub use table::table;

use crate::evaluation::Report;

/// The reports of a suite, in the order in which they are shown: policies, then objects.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Suite {
    /// A report of each policy or control on each object.
    pub reports: Vec<Report>,
}

impl Suite {
    /// Who acts, each once.
    pub fn policies(&self) -> Vec<&str> {
        each_once(self.reports.iter().map(|report| report.policy.as_str()))
    }

    /// What is grasped, each once.
    pub fn objects(&self) -> Vec<&str> {
        each_once(self.reports.iter().map(|report| report.object.as_str()))
    }

    /// The report of a policy on an object.
    pub fn report(&self, policy: &str, object: &str) -> Option<&Report> {
        self.reports.iter().find(|report| report.policy == policy && report.object == object)
    }
}

fn each_once<'a>(words: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut found = Vec::new();
    for word in words {
        if !found.contains(&word) {
            found.push(word);
        }
    }
    found
}

#[cfg(test)]
pub(crate) mod samples {
    use super::*;
    use crate::evaluation::Row;
    use rollout::{Failure, Verdict, wilson95};
    use std::collections::BTreeMap;

    /// A report of attempts, from seed 0, that lifted or missed.
    pub(crate) fn report(policy: &str, object: &str, lifts: &[bool]) -> Report {
        let row = |(seed, lifts): (usize, &bool)| Row {
            seed: seed as u64,
            pose: [0.6, 0.0, 0.0],
            verdict: match lifts {
                true => Verdict::Lifted { slip: 0.0 },
                false => Verdict::Failed { reason: Failure::Missed },
            },
            state_hash: String::new(),
            motion: None,
            clearance: None,
            likeness: None,
            object_from_palm: None,
        };
        let lifted = lifts.iter().filter(|lifts| **lifts).count();
        Report {
            policy: policy.into(),
            object: object.into(),
            attempts: lifts.len(),
            lifted,
            wilson95: wilson95(lifted, lifts.len()),
            failures: BTreeMap::from([("missed".into(), lifts.len() - lifted)]),
            seed: 0,
            scene_hash: "scene".into(),
            object_hash: object.into(),
            stands: None,
            model_hash: None,
            rows: lifts.iter().enumerate().map(row).collect(),
        }
    }
}
