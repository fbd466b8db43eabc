//! Effort of a search, and the criteria of a robust grasp.

use crate::RobotContext;
use crate::search::candidates::CandidateConfig;

/// Effort of a search, and the criteria of a robust grasp.
#[derive(Clone, Debug)]
pub struct SearchConfig {
    /// Maximum number of candidate palm poses.
    pub max_candidates: usize,
    /// The first stage stops at this many candidates with balanced forces.
    pub max_closed: usize,
    /// Trials of these candidates stop at this many robust grasps.
    pub target_robust: usize,
    /// Medoids of the most robust grasps. The search continues around these, then around their half turns.
    pub num_refine_seeds: usize,
    /// Maximum number of perturbed palm poses per medoid.
    pub max_perturbations: usize,
    /// Perturbation of a medoid stops at this many lifting grasps.
    pub target_per_seed: usize,
    /// Maximum perturbation of the palm along each of its axes (m).
    pub palm_shift: f64,
    /// Maximum perturbation of the palm about each of its axes (rad).
    pub palm_turn: f64,
    /// Number of perturbed repeats of a trial that lifted.
    pub num_repeats: usize,
    /// Minimum number of repeats that must lift.
    pub min_repeat_successes: usize,
    /// Maximum displacement of the object in a repeat along x and y (m).
    pub object_shift: f32,
    /// Maximum yaw displacement of the object in a repeat (rad).
    pub object_turn: f32,
    /// Maximum slip of the object in the palm (m) in a trial that counts as lifted.
    pub max_slip: f32,
    /// Number of clusters (paper §II-A: N = 7).
    pub num_clusters: usize,
    /// How candidates are sampled and rejected.
    pub candidate: CandidateConfig,
}

impl SearchConfig {
    /// The paper's N; the other values are ours. The perturbation of the repeats matches the pose error of a
    /// policy that is conditioned on one point cloud.
    pub fn paper(robot: &RobotContext) -> Self {
        Self {
            max_candidates: 60_000,
            max_closed: 250,
            target_robust: 20,
            num_refine_seeds: 6,
            max_perturbations: 1500,
            target_per_seed: 5,
            palm_shift: 0.008,
            palm_turn: 0.1,
            num_repeats: 10,
            min_repeat_successes: 7,
            object_shift: 0.015,
            object_turn: 0.2,
            max_slip: 0.025,
            num_clusters: 7,
            candidate: CandidateConfig::standard(&robot.config, &robot.tree.hand),
        }
    }

    /// Three times as many closed candidates, robust grasps and medoids, for heavy objects, which few grasps
    /// lift.
    pub fn thorough(robot: &RobotContext) -> Self {
        Self { max_closed: 800, target_robust: 60, num_refine_seeds: 18, ..Self::paper(robot) }
    }

    /// A few robust grasps in one or two clusters, for interactive use.
    pub fn quick(robot: &RobotContext) -> Self {
        Self {
            max_candidates: 12_000,
            max_closed: 60,
            target_robust: 4,
            num_refine_seeds: 1,
            max_perturbations: 200,
            target_per_seed: 2,
            num_repeats: 4,
            min_repeat_successes: 3,
            num_clusters: 3,
            ..Self::paper(robot)
        }
    }

    /// For [`refine_around`](crate::search::refine_around): more robust grasps per palm pose, from fewer candidates.
    pub fn refinement(robot: &RobotContext) -> Self {
        Self { max_perturbations: 800, target_per_seed: 8, ..Self::paper(robot) }
    }
}
