//! Evaluation: attempts by the protocol, counted with the Wilson interval and the reasons of failure.

use anyhow::Result;
use geometry::object::Object;
use rayon::prelude::*;
use rollout::workcell::object_hash;
use rollout::{Attempt, Controller, Verdict, Workcell};
use std::collections::BTreeMap;

/// One attempt of an evaluation.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// Seed of the attempt.
    pub seed: u64,
    /// Pose of the object: x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// How it ended.
    pub verdict: Verdict,
    /// Hash of the final state.
    pub state_hash: String,
}

/// The result of an evaluation.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Who acted.
    pub policy: String,
    /// Name of the object.
    pub object: String,
    /// Attempts.
    pub attempts: usize,
    /// Attempts that lifted.
    pub lifted: usize,
    /// Wilson 95 % interval of the success rate.
    pub wilson95: [f64; 2],
    /// Failures by reason.
    pub failures: BTreeMap<String, usize>,
    /// Seed of the first attempt; the others follow.
    pub seed: u64,
    /// Hash of the scene and robot.
    pub scene_hash: String,
    /// Hash of the object.
    pub object_hash: String,
    /// Every attempt.
    pub rows: Vec<Row>,
}

/// Runs one attempt for each seed on all threads; none is left out. Each draws the object's pose, unless
/// one is given for all.
pub fn evaluate(
    workcell: &Workcell,
    object: &Object,
    name: &str,
    controller: &Controller,
    pose: Option<[f32; 3]>,
    seeds: std::ops::Range<u64>,
    progress: &(dyn Fn(bool) + Sync),
) -> Result<Report> {
    let (seed, attempts) = (seeds.start, seeds.clone().count());
    let rows = seeds
        .into_par_iter()
        .map(|seed| {
            let mut attempt =
                Attempt::begin(workcell, object, name, pose, seed, controller.clone())?;
            let verdict = attempt.run(workcell);
            progress(verdict.is_lifted());
            Ok(Row { seed, pose: attempt.pose(), verdict, state_hash: attempt.state_hash() })
        })
        .collect::<Result<Vec<_>>>()?;
    let lifted = rows.iter().filter(|row| row.verdict.is_lifted()).count();
    let mut failures = BTreeMap::new();
    for row in &rows {
        if let Verdict::Failed { reason } = row.verdict {
            let reason = serde_json::to_value(reason)?;
            *failures.entry(reason.as_str().unwrap_or_default().to_owned()).or_insert(0) += 1;
        }
    }
    Ok(Report {
        policy: label(controller).to_owned(),
        object: name.to_owned(),
        attempts,
        lifted,
        wilson95: wilson95(lifted, attempts),
        failures,
        seed,
        scene_hash: scene::config::scene_hash(),
        object_hash: object_hash(object),
        rows,
    })
}

/// Name of a controller in reports.
pub fn label(controller: &Controller) -> &'static str {
    match controller {
        Controller::Policy => "policy",
        Controller::ShuffledLatent => "shuffled z",
        Controller::ZeroLatent => "zero z",
        Controller::Script => "no policy",
        Controller::Planner => "planner",
        Controller::Replay { .. } => "replay",
    }
}

/// The Wilson 95 % interval of k successes in n trials.
pub fn wilson95(k: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    const Z: f64 = 1.959_963_984_540_054;
    let (n, p) = (n as f64, k as f64 / n as f64);
    let middle = p + Z * Z / (2.0 * n);
    let spread = Z * libm::sqrt(p * (1.0 - p) / n + Z * Z / (4.0 * n * n));
    let scale = 1.0 + Z * Z / n;
    [((middle - spread) / scale).max(0.0), ((middle + spread) / scale).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_intervals_match_published_values() {
        // Newcombe (1998), table I: 81 of 263 gives 0.2553 to 0.3662; 0 of 20 gives 0 to 0.1611.
        let [low, high] = wilson95(81, 263);
        assert!((low - 0.2553).abs() < 5e-5 && (high - 0.3662).abs() < 5e-5, "{low} {high}");
        let [low, high] = wilson95(0, 20);
        assert!(low == 0.0 && (high - 0.1611).abs() < 5e-5, "{low} {high}");
    }
}
