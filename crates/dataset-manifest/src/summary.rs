//! Counts and statistics of a dataset, by object.

use std::collections::BTreeMap;

/// File with the [`Summary`] of each object.
pub const SUMMARY_FILE: &str = "summary.json";

/// Outcome of the trials whose demonstrations the dataset contains.
pub const KEPT: &str = "kept";

/// Counts of one object. Ratios are stored as pairs `[count, total]`.
///
/// ```rust
/// use dataset_manifest::{KEPT, Summary};
/// // 30 trials became demonstrations, 2 were rejected.
/// let outcomes = [(KEPT.to_owned(), 30), ("slipped".to_owned(), 2)].into();
/// let summary = Summary { outcomes, ..Summary::default() };
/// assert_eq!((summary.kept(), summary.trials()), (30, 32));
/// ```
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Summary {
    /// Number of poses of the object.
    pub poses: usize,
    /// Poses without a trial, because no grasp is reachable or the object has no grasps.
    pub unreachable: usize,
    /// Poses with at least a quarter of the requested demonstrations.
    pub well_covered: usize,
    /// Minimum fraction of well-covered poses over eight sectors of yaw.
    pub min_yaw_coverage: f32,
    /// Minimum fraction of well-covered poses over the quarters of the workspace.
    pub min_area_coverage: f32,
    /// Number of poses covered by each grasp index.
    pub grasps: BTreeMap<usize, usize>,
    /// Number of trials by outcome.
    pub outcomes: BTreeMap<String, usize>,
    /// Replays with a hold of 2 s and shaking, before any filter: `[held, replayed]`.
    pub survived_shaking: [usize; 2],
    /// Perturbed replays of kept demonstrations: `[lifted, replayed]`.
    pub lifted_perturbed: [usize; 2],
    /// Duration (s) of the kept demonstrations: `[median, p90]`.
    pub duration: [f32; 2],
    /// RMS jerk (rad/s³) of the kept demonstrations before contact: `[median, p90]`.
    pub jerk: [f32; 2],
    /// Clearance (m) of the robot from object and table up to contact, where the fingers approach the object:
    /// `[minimum, median]`.
    pub clearance: [f32; 2],
    /// Slip (m) of the object in the hand: `[median, p90]`.
    pub slip: [f32; 2],
    /// Maximum number of planner restarts of a kept demonstration.
    pub max_restarts: usize,
    /// Reachable pre-grasp targets: `[reached by the planner, all]`.
    pub goals_reached: [usize; 2],
    /// Maximum joint difference (rad) between the postures of one grasp at neighboring poses.
    pub max_joint_jump: f32,
}

impl Summary {
    /// Number of trials.
    pub fn trials(&self) -> usize {
        self.outcomes.values().sum()
    }

    /// Number of kept demonstrations.
    pub fn kept(&self) -> usize {
        self.outcomes.get(KEPT).copied().unwrap_or(0)
    }
}
