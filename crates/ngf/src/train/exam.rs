//! What a policy can do while it is being trained: free roll-outs, stability, and attempts in physics.

use anyhow::Result;
use dataset::generate::built_in_object;
use geometry::object::Object;
use imitation::evaluation::evaluate;
use imitation::free_rollout::{fingertip_errors, greatest_damping};
use imitation::lesson::Lesson;
use imitation::model_files::ModelFiles;
use imitation::spread::Spread;
use policy::weights::Tensors;
use policy::{Network, PolicyConfig};
use robot::Tree;
use rollout::{Controller, Workcell, wilson95};
use std::collections::BTreeMap;
use std::fmt;

/// Where and with what a policy is examined.
pub(super) struct Exam {
    workcell: Workcell,
    /// Those of the dataset that are built in; a mesh of somebody's is no longer at hand.
    objects: Vec<(String, Object)>,
    threads: rayon::ThreadPool,
}

/// Lessons of which free roll-outs are made, spread over all objects.
const LESSONS: usize = 60;

/// Attempts, spread over all objects.
const ATTEMPTS: usize = 24;

/// Their first seed: published counts begin at 0.
const FIRST_SEED: u64 = 1 << 40;

/// A policy whose fingertips end farther (m, median) from where they should on held-out poses is not tried in physics:
/// it would lift nothing.
const SOUND: f64 = 0.05;

/// What was found.
#[derive(serde::Serialize)]
pub(super) struct Found {
    /// Distance (m) of the fingertips from where the demonstrations have them, after free roll-outs on poses that are
    /// taught and on those that are held out.
    fingertip_error_m: BTreeMap<&'static str, Spread>,
    /// Greatest λ_max(B) + β (1/s) on held-out poses, of a fabric; 60 is the edge of stability.
    greatest_damping: Option<f64>,
    /// Attempts by the protocol, and those that lifted.
    attempts: usize,
    lifted: usize,
}

impl Exam {
    pub(super) fn new(names: &[String], threads: usize) -> Result<Self> {
        let known = |name: &String| Some((name.clone(), built_in_object(name).ok()?));
        Ok(Self {
            workcell: Workcell::new()?,
            objects: names.iter().filter_map(known).collect(),
            threads: rayon::ThreadPoolBuilder::new().num_threads(threads).build()?,
        })
    }

    /// The robot.
    pub(super) fn tree(&self) -> &Tree {
        &self.workcell.robot.tree
    }

    /// Examines the model of these files.
    pub(super) fn take(
        &mut self,
        config: &PolicyConfig,
        files: &ModelFiles,
        lessons: [(&'static str, &[Lesson]); 2],
    ) -> Result<Found> {
        let tree = &self.workcell.robot.tree;
        let network = Network::load(&Tensors::parse(&files.weights)?, config, &tree.limits)?;
        let mut fingertip_error_m = BTreeMap::new();
        for (label, lessons) in lessons {
            let shown = spread(lessons);
            let errors = self.threads.install(|| fingertip_errors(tree, &network, &shown));
            if let Some(spread) = Spread::of(errors) {
                fingertip_error_m.insert(label, spread);
            }
        }
        let [_, (_, held_out)] = lessons;
        let held_out = spread(held_out);
        let greatest_damping = self.threads.install(|| greatest_damping(&network, &held_out));
        let is_sound = fingertip_error_m.get("held_out").is_none_or(|off| off.median < SOUND);
        self.workcell.load_model(&files.weights, &files.starts, &files.config)?;
        let (mut attempts, mut lifted) = (0, 0);
        for (i, (name, object)) in self.objects.iter().enumerate().filter(|_| is_sound) {
            // As even a share for each object as there is.
            let [first, end] = [i, i + 1].map(|k| k * ATTEMPTS / self.objects.len());
            let seeds = FIRST_SEED + first as u64..FIRST_SEED + end as u64;
            let controller = Controller::Policy;
            let report = self.threads.install(|| {
                evaluate(&self.workcell, object, name, &controller, None, seeds, &|_| Ok(()))
            })?;
            attempts += report.attempts;
            lifted += report.lifted;
        }
        Ok(Found { fingertip_error_m, greatest_damping, attempts, lifted })
    }
}

/// As many lessons as are looked at, evenly out of all.
fn spread(lessons: &[Lesson]) -> Vec<&Lesson> {
    lessons.iter().step_by(lessons.len().div_ceil(LESSONS).max(1)).collect()
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.attempts == 0 {
            write!(f, "  not tried in physics")?;
        } else {
            let [low, high] = wilson95(self.lifted, self.attempts).map(|x| 100.0 * x);
            write!(f, "  {} of {} lifted ({low:.0}..{high:.0} %)", self.lifted, self.attempts)?;
        }
        for (label, Spread { median, p90 }) in &self.fingertip_error_m {
            let [mm, mm90] = [median, p90].map(|x| 1e3 * x);
            write!(f, "; {label}: fingertips off by {mm:.1} mm (median), {mm90:.1} mm (p90)")?;
        }
        match self.greatest_damping {
            Some(damping) => write!(f, "; damping up to {damping:.1} of 60 /s"),
            None => Ok(()),
        }
    }
}
