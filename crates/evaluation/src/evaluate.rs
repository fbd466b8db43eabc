//! Evaluation: runs attempts under the protocol, and reports the success rate with its Wilson interval and
//! the failure reasons.

use crate::percentiles::median;
use anyhow::Result;
use objects::import::Orientation;
use objects::object::Object;
use rayon::prelude::*;
use robot::Isometry;
use rollout::{Attempt, Controller, Familiarity, Lockstep, MotionMetrics, Outcome, RolloutContext};
use std::collections::BTreeMap;

/// Result of one attempt of an evaluation.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct AttemptResult {
    /// Seed of the attempt.
    pub seed: u64,
    /// Pose of the object: x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Outcome of the attempt.
    pub outcome: Outcome,
    /// Hash of the final simulation state.
    pub final_state_hash: String,
    /// Motion metrics of the controller; `None` if it did not run.
    pub motion: Option<MotionMetrics>,
    /// Min. clearance (m) before the hand closes ([`Attempt::clearance`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clearance: Option<f32>,
    /// Similarity of the object to the model's training data ([`Attempt::familiarity`]); `None` without a
    /// model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub familiarity: Option<Familiarity>,
    /// Palm pose relative to the initial object pose, at the start of the lift ([`Attempt::object_from_palm`]).
    /// Identifies the grasp, with the convention of grasp files; `None` without a lift.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_from_palm: Option<Isometry>,
}

/// The result of an evaluation.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct EvaluationReport {
    /// Label of the policy or control, set by the caller.
    pub policy: String,
    /// Catalogue name of the object, or name of its mesh.
    pub object: String,
    /// Number of attempts.
    pub attempts: usize,
    /// Number of attempts that lifted the object.
    pub lifted: usize,
    /// Wilson 95 % interval of the success rate.
    pub wilson95: [f64; 2],
    /// Number of failures by reason.
    pub failures: BTreeMap<String, usize>,
    /// Seed of the first attempt; the next attempts use the consecutive seeds.
    pub seed: u64,
    /// Hash of the scene and robot.
    pub scene_hash: String,
    /// Hash of the object.
    pub object_hash: String,
    /// Orientation of an object from a mesh file, set by the caller.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<Orientation>,
    /// Hash of the model's files. In a comparison, hash of the controller's input: model, grasps of the
    /// planner, or dataset.
    pub model_hash: Option<String>,
    /// Results of all attempts, by seed.
    pub rows: Vec<AttemptResult>,
}

impl AttemptResult {
    /// `None` without an outcome.
    fn new(attempt: &Attempt, context: &RolloutContext) -> Option<Self> {
        Some(Self {
            seed: attempt.seed(),
            pose: attempt.pose(),
            outcome: attempt.outcome()?,
            final_state_hash: attempt.state_hash(),
            motion: attempt.motion_metrics(),
            clearance: attempt.clearance(context),
            familiarity: attempt.familiarity(context),
            object_from_palm: attempt.object_from_palm(context),
        })
    }
}

impl EvaluationReport {
    /// Median reconstruction error (m) of the encoder over the attempts.
    pub fn median_reconstruction_error(&self) -> Option<f32> {
        let errors =
            self.familiarities().map(|familiarity| f64::from(familiarity.reconstruction_error));
        median(errors.collect()).map(|error| error as f32)
    }

    /// The training object that is the nearest one in most attempts.
    pub fn nearest_object(&self) -> Option<&str> {
        let mut counts = BTreeMap::new();
        for nearest in self.familiarities().filter_map(|familiarity| familiarity.nearest.as_ref()) {
            *counts.entry(nearest.base_name()).or_insert(0) += 1;
        }
        counts.into_iter().max_by_key(|(_, count)| *count).map(|(object, _)| object)
    }

    fn familiarities(&self) -> impl Iterator<Item = &Familiarity> {
        self.rows.iter().filter_map(|row| row.familiarity.as_ref())
    }
}

/// Runs one attempt per seed on all threads; all attempts count. Each attempt samples the object pose, unless
/// `pose` is given. `on_attempt` receives each attempt after its end.
pub fn evaluate(
    context: &RolloutContext,
    object: &Object,
    name: &str,
    controller: &Controller,
    pose: Option<[f32; 3]>,
    seeds: std::ops::Range<u64>,
    on_attempt: &(dyn Fn(&Attempt) -> Result<()> + Sync),
) -> Result<EvaluationReport> {
    let (seed, attempts) = (seeds.start, seeds.clone().count());
    let new_attempt = |seed| Attempt::new(context, object, name, pose, seed, controller.clone());
    let size = lockstep_size(attempts, rayon::current_num_threads());
    let groups = seeds.clone().step_by(size).collect::<Vec<u64>>();
    let rows = groups
        .into_par_iter()
        .map(|first| {
            let group = first..seeds.end.min(first + size as u64);
            let mut running = Lockstep::new(group.map(new_attempt).collect::<Result<_, _>>()?);
            let mut rows = Vec::new();
            while !running.is_empty() {
                if let Some(attempt) = running.advance(context) {
                    on_attempt(&attempt)?;
                    rows.extend(AttemptResult::new(&attempt, context));
                }
            }
            rows.sort_by_key(|row: &AttemptResult| row.seed);
            Ok(rows)
        })
        .collect::<Result<Vec<_>>>()?
        .concat();
    let lifted = rows.iter().filter(|row| row.outcome.is_lifted()).count();
    let mut failures = BTreeMap::new();
    for row in &rows {
        if let Outcome::Failed { reason } = row.outcome {
            let reason = serde_json::to_value(reason)?;
            *failures.entry(reason.as_str().unwrap_or_default().to_owned()).or_insert(0) += 1;
        }
    }
    Ok(EvaluationReport {
        policy: String::new(),
        object: name.to_owned(),
        attempts,
        lifted,
        wilson95: rollout::wilson95(lifted, attempts),
        failures,
        seed,
        scene_hash: scene::scene_hash(),
        object_hash: object.hash(),
        orientation: None,
        model_hash: None,
        rows,
    })
}

/// Attempts per group, such that all threads execute about the same number of attempts.
fn lockstep_size(attempts: usize, threads: usize) -> usize {
    let rounds = attempts.div_ceil(threads * Lockstep::MAX_GROUP).max(1);
    attempts.div_ceil(threads * rounds).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_equal_for_all_threads() {
        for (attempts, threads, size) in
            [(0, 2, 1), (1, 8, 1), (2, 2, 1), (20, 2, 5), (100, 2, 8), (100, 16, 7)]
        {
            assert_eq!(lockstep_size(attempts, threads), size, "{attempts} on {threads}");
        }
    }
}
