//! Effort of a search, and the criteria of a robust grasp.

use crate::RobotContext;
use crate::search::candidates::CandidateConfig;

/// Effort of a search, and the criteria of a robust grasp.
#[derive(Clone, Debug)]
pub struct SearchConfig {
    /// Maximum number of candidate palm poses.
    pub max_candidates: usize,
    /// Sampling stops at this many candidates with balanced forces.
    pub max_closed: usize,
    /// Maximum number of candidates that are tested: first the motion into the grasp, then trials in physics. Half
    /// turns of robust grasps are not counted.
    pub max_tested: usize,
    /// Factor on the maximum numbers of closed and tested candidates where grasps lift but none is robust. The search
    /// would end without a grasp.
    pub extension: usize,
    /// The search stops when this many tested candidates have added no object pose.
    pub max_fruitless: usize,
    /// The search stops at this many robust grasps.
    pub target_robust: usize,
    /// The search stops when robust grasps cover this fraction of the object poses that any closed candidate
    /// covers. Above 1, coverage is ignored.
    pub target_coverage: f64,
    /// Maximum number of perturbed palm poses of a refinement.
    pub max_perturbations: usize,
    /// A refinement stops at this many lifting grasps.
    pub target_per_seed: usize,
    /// Maximum perturbation of the palm along each of its axes (m).
    pub palm_shift: f64,
    /// Maximum perturbation of the palm about each of its axes (rad).
    pub palm_turn: f64,
    /// Number of perturbed repeats after which a grasp counts as robust for the time being.
    pub num_screening_repeats: usize,
    /// Number of perturbed repeats of a selected grasp.
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
            max_tested: 100,
            extension: 3,
            max_fruitless: 16,
            target_robust: 40,
            target_coverage: 0.98,
            max_perturbations: 1500,
            target_per_seed: 5,
            palm_shift: 0.008,
            palm_turn: 0.1,
            num_screening_repeats: 3,
            num_repeats: 10,
            min_repeat_successes: 7,
            object_shift: 0.015,
            object_turn: 0.2,
            max_slip: 0.025,
            num_clusters: 7,
            candidate: CandidateConfig::standard(&robot.config, &robot.tree.hand),
        }
    }

    /// Many robust grasps, without regard to coverage, for [`robustness`](crate::search::robustness).
    pub fn thorough(robot: &RobotContext) -> Self {
        Self {
            max_closed: 800,
            max_tested: 600,
            max_fruitless: usize::MAX,
            target_robust: 120,
            target_coverage: f64::INFINITY,
            ..Self::paper(robot)
        }
    }

    /// A few robust grasps, for interactive use.
    pub fn quick(robot: &RobotContext) -> Self {
        Self {
            max_candidates: 12_000,
            max_closed: 48,
            max_tested: 40,
            extension: 1,
            max_fruitless: 8,
            target_robust: 8,
            target_coverage: 0.9,
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

    /// Whether candidates are ranked by the poses that they add.
    pub(crate) fn needs_coverage(&self) -> bool {
        self.target_coverage <= 1.0
    }
}
