//! Validation of a policy during training: rollouts without physics, damping rate, and attempts in physics.

use anyhow::Result;
use evaluation::evaluate;
use evaluation::percentiles::MedianP90;
use imitation::data::demo_group::DemoGroup;
use imitation::models::export::ModelFiles;
use imitation::validate::kinematic_rollout::{fingertip_errors, max_damping_rate};
use objects::catalog::built_in_object;
use objects::object::Object;
use policy::weights::Tensors;
use policy::{Network, PolicyConfig};
use robot::KinematicTree;
use rollout::{Controller, RolloutContext, wilson95};
use std::collections::BTreeMap;
use std::fmt;

/// Scene, objects and threads of the validation.
pub(super) struct Validation {
    context: RolloutContext,
    /// Built-in objects of the dataset; user meshes are not available here.
    objects: Vec<(String, Object)>,
    pool: rayon::ThreadPool,
}

/// Demonstration groups for rollouts, spread evenly over all objects.
const MAX_GROUPS: usize = 60;

/// Number of attempts, spread evenly over all objects.
const NUM_ATTEMPTS: usize = 24;

/// Seed of the first attempt, disjoint from the published evaluations, which start at 0.
const FIRST_SEED: u64 = 1 << 40;

/// Maximum median fingertip error (m) on held-out poses for which attempts in physics are run. A policy with
/// a larger error lifts nothing.
const MAX_TIP_ERROR_FOR_PHYSICS: f64 = 0.05;

/// Result of a validation.
#[derive(serde::Serialize)]
pub(super) struct ValidationResult {
    /// Distance (m) between the fingertips after a rollout and in the demonstrations, by split (`train`,
    /// `held_out`).
    fingertip_error_m: BTreeMap<&'static str, MedianP90>,
    /// Maximum λ_max(B) + β (1/s) on held-out poses, for fabric policies; 60 is the stability limit.
    max_damping_rate: Option<f64>,
    /// Attempts under the protocol, and the number that lifted.
    attempts: usize,
    lifted: usize,
}

impl Validation {
    pub(super) fn new(names: &[String], threads: usize) -> Result<Self> {
        let load_object = |name: &String| Some((name.clone(), built_in_object(name).ok()?));
        Ok(Self {
            context: RolloutContext::new()?,
            objects: names.iter().filter_map(load_object).collect(),
            pool: rayon::ThreadPoolBuilder::new().num_threads(threads).build()?,
        })
    }

    /// Kinematic tree of the robot.
    pub(super) fn tree(&self) -> &KinematicTree {
        &self.context.robot.tree
    }

    /// Validates the model in these files.
    pub(super) fn run(
        &mut self,
        config: &PolicyConfig,
        files: &ModelFiles,
        groups: [(&'static str, &[DemoGroup]); 2],
    ) -> Result<ValidationResult> {
        let tree = &self.context.robot.tree;
        let network = Network::load(&Tensors::parse(&files.weights)?, config, tree)?;
        let mut fingertip_error_m = BTreeMap::new();
        for (label, groups) in groups {
            let sample = subsample(groups);
            let errors = self.pool.install(|| fingertip_errors(tree, &network, &sample));
            if let Some(spread) = MedianP90::of(errors) {
                fingertip_error_m.insert(label, spread);
            }
        }
        let [_, (_, held_out)] = groups;
        let held_out = subsample(held_out);
        let max_damping_rate = self.pool.install(|| max_damping_rate(&network, &held_out));
        let runs_physics = fingertip_error_m
            .get("held_out")
            .is_none_or(|error| error.median < MAX_TIP_ERROR_FOR_PHYSICS);
        self.context.load_model(&files.weights, &files.starts, &files.config)?;
        let (mut attempts, mut lifted) = (0, 0);
        for (i, (name, object)) in self.objects.iter().enumerate().filter(|_| runs_physics) {
            // Distributes the attempts evenly over the objects.
            let [first, end] = [i, i + 1].map(|k| k * NUM_ATTEMPTS / self.objects.len());
            let seeds = FIRST_SEED + first as u64..FIRST_SEED + end as u64;
            let controller = Controller::Policy;
            let report = self.pool.install(|| {
                evaluate(&self.context, object, name, &controller, None, seeds, &|_| Ok(()))
            })?;
            attempts += report.attempts;
            lifted += report.lifted;
        }
        Ok(ValidationResult { fingertip_error_m, max_damping_rate, attempts, lifted })
    }
}

/// Selects up to about [`MAX_GROUPS`] demonstration groups at equal intervals.
fn subsample(groups: &[DemoGroup]) -> Vec<&DemoGroup> {
    groups.iter().step_by(groups.len().div_ceil(MAX_GROUPS).max(1)).collect()
}

impl fmt::Display for ValidationResult {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.attempts == 0 {
            write!(f, "  skipped physics")?;
        } else {
            let [low, high] = wilson95(self.lifted, self.attempts).map(|x| 100.0 * x);
            write!(f, "  {} of {} lifted ({low:.0}..{high:.0} %)", self.lifted, self.attempts)?;
        }
        for (label, MedianP90 { median, p90 }) in &self.fingertip_error_m {
            let [mm, mm90] = [median, p90].map(|x| 1e3 * x);
            write!(f, "; {label}: fingertip error {mm:.1} mm (median), {mm90:.1} mm (p90)")?;
        }
        match self.max_damping_rate {
            Some(damping) => write!(f, "; max damping rate {damping:.1} of 60 /s"),
            None => Ok(()),
        }
    }
}
