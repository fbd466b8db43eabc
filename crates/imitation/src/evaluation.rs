//! Evaluation: attempts by the protocol, counted with the Wilson interval and the reasons of failure.

use crate::spread::median;
use anyhow::Result;
use geometry::brought::Stands;
use geometry::object::Object;
use rayon::prelude::*;
use robot::Isometry;
use rollout::{Attempt, Controller, Likeness, Motion, Verdict, Workcell};
use std::collections::BTreeMap;

/// One attempt of an evaluation.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Row {
    /// Seed of the attempt.
    pub seed: u64,
    /// Pose of the object: x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// How it ended.
    pub verdict: Verdict,
    /// Hash of the final state.
    pub state_hash: String,
    /// How the controller moved, if it came to act.
    pub motion: Option<Motion>,
    /// How far it kept off before it closed ([`Attempt::clearance`], m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clearance: Option<f32>,
    /// How like what the model learned from the object looked ([`Attempt::likeness`]), where one was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub likeness: Option<Likeness>,
    /// Where the hand came to hold it ([`Attempt::object_from_palm`]), as files of grasps have it: which grasp was tried.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_from_palm: Option<Isometry>,
}

/// The result of an evaluation.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Report {
    /// Who acted, in the words of the caller.
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
    /// How the object stands, if it is of a mesh file, where whoever read the file says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stands: Option<Stands>,
    /// Hash of the model's files, if a model acted; in a suite, of what it acted by: the planner's grasps, the dataset.
    pub model_hash: Option<String>,
    /// Every attempt.
    pub rows: Vec<Row>,
}

impl Report {
    /// How far (m) the encoder was off, the median.
    pub fn off(&self) -> Option<f32> {
        let off = self.likenesses().map(|likeness| f64::from(likeness.off));
        median(off.collect()).map(|off| off as f32)
    }

    /// What the object looked like most often, of what the model learned from.
    pub fn most_like(&self) -> Option<&str> {
        let mut counts = BTreeMap::new();
        for nearest in self.likenesses().filter_map(|likeness| likeness.most.as_ref()) {
            *counts.entry(nearest.base()).or_insert(0) += 1;
        }
        counts.into_iter().max_by_key(|(_, count)| *count).map(|(object, _)| object)
    }

    fn likenesses(&self) -> impl Iterator<Item = &Likeness> {
        self.rows.iter().filter_map(|row| row.likeness.as_ref())
    }
}

/// Runs one attempt for each seed on all threads; none is left out. Each draws the object's pose, unless
/// one is given for all. `observe` gets each attempt when it is over.
pub fn evaluate(
    workcell: &Workcell,
    object: &Object,
    name: &str,
    controller: &Controller,
    pose: Option<[f32; 3]>,
    seeds: std::ops::Range<u64>,
    observe: &(dyn Fn(&Attempt) -> Result<()> + Sync),
) -> Result<Report> {
    let (seed, attempts) = (seeds.start, seeds.clone().count());
    let rows = seeds
        .into_par_iter()
        .map(|seed| {
            let mut attempt =
                Attempt::begin(workcell, object, name, pose, seed, controller.clone())?;
            let verdict = attempt.run(workcell);
            observe(&attempt)?;
            Ok(Row {
                seed,
                pose: attempt.pose(),
                verdict,
                state_hash: attempt.state_hash(),
                motion: attempt.motion(),
                clearance: attempt.clearance(workcell),
                likeness: attempt.likeness(workcell),
                object_from_palm: attempt.object_from_palm(workcell),
            })
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
        policy: String::new(),
        object: name.to_owned(),
        attempts,
        lifted,
        wilson95: rollout::wilson95(lifted, attempts),
        failures,
        seed,
        scene_hash: scene::config::scene_hash(),
        object_hash: object.hash(),
        stands: None,
        model_hash: None,
        rows,
    })
}
