//! Work of a grasp search, in independent tasks: close the hand, try a grasp, count its reachable poses.
//!
//! A task is plain data and its result depends on nothing else. Threads of a process and workers of a page
//! execute the same tasks with the same results.

use crate::plan::object_poses::{PlannedGrasp, coverage_poses, reachability};
use crate::search::candidates::{NearMiss, Rejected, Rejections};
use crate::search::pinch::PinchPlan;
use crate::search::tester::{GraspTester, Trial};
use crate::search::{candidates, pinch, robustness};
use crate::set::clusters::half_turn;
use crate::set::grasp::Grasp;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use robot::Isometry;
use scene::SceneError;
use serde::{Deserialize, Serialize};

/// One unit of work.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Task {
    /// Close the hand at the palm poses of the candidates `first..first + count`.
    Close {
        /// Index of the first candidate; determines its random numbers.
        first: usize,
        /// Number of candidates.
        count: usize,
        /// Where palm poses are sampled.
        region: Region,
    },
    /// Try a grasp in physics.
    Try {
        /// The grasp.
        grasp: Grasp,
        /// Index of the object yaw; `None` selects the yaw that is easiest to reach.
        yaw: Option<usize>,
        /// Displacement of the object.
        trial: Trial,
    },
    /// Plan motions into a grasp at a few of the coverage poses at which it is reachable.
    Approach {
        /// The grasp.
        grasp: Grasp,
    },
    /// Determine the coverage poses at which a grasp is reachable.
    Reach {
        /// The grasp.
        grasp: Grasp,
    },
}

/// Where palm poses are sampled.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Region {
    /// All around the object.
    Everywhere,
    /// Around a palm pose (object frame).
    Around(Isometry),
    /// Around a pinch.
    AroundPinch(PinchPlan),
    /// Around the half turn of a palm pose (object frame).
    AroundHalfTurn(Isometry),
}

impl Region {
    /// Around a candidate: its pinch, or its palm pose (object frame).
    pub(crate) fn around(object_from_palm: &Isometry, pinch: &Option<PinchPlan>) -> Self {
        match pinch {
            Some(plan) => Self::AroundPinch(plan.clone()),
            None => Self::Around(*object_from_palm),
        }
    }
}

/// Result of a task.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum TaskResult {
    /// Candidates with balanced contact forces, and the others.
    Closed {
        /// Accepted candidates.
        candidates: Vec<ClosedCandidate>,
        /// Numbers of the others.
        rejections: Rejections,
        /// The best one of the others.
        near_miss: Option<NearMiss>,
    },
    /// Outcome of a trial; `None` if the grasp cannot be reached.
    Tried(Option<TrialResult>),
    /// Whether motions into the grasp are found.
    Approached(bool),
    /// Whether the grasp is reachable at each coverage pose.
    Reached(Vec<bool>),
}

impl Task {
    /// The task as bytes, for a worker that shares no memory.
    pub fn to_bytes(&self) -> Vec<u8> {
        to_bytes(self)
    }

    /// Inverse of [`Task::to_bytes`].
    ///
    /// # Errors
    /// The bytes are not a task of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        postcard::from_bytes(bytes)
    }
}

impl TaskResult {
    /// The result as bytes, for the worker that runs the search.
    pub fn to_bytes(&self) -> Vec<u8> {
        to_bytes(self)
    }

    /// Inverse of [`TaskResult::to_bytes`].
    ///
    /// # Errors
    /// The bytes are not a result of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        postcard::from_bytes(bytes)
    }
}

fn to_bytes(value: &impl Serialize) -> Vec<u8> {
    // Only sequences of unknown length fail.
    postcard::to_allocvec(value).unwrap_or_default()
}

/// A candidate whose closed hand has balanced contact forces.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ClosedCandidate {
    /// The grasp.
    pub grasp: Grasp,
    /// Parameters of the pinch; `None` if the hand was closed at the palm pose.
    pub pinch: Option<PinchPlan>,
    /// Force margin of the squeeze (dimensionless).
    pub force_margin: f64,
    /// Whether the grasp is reachable at every 10th coverage pose.
    pub sparse_reach: Vec<bool>,
}

/// Outcome of a trial.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TrialResult {
    /// Index of the object yaw.
    pub yaw: usize,
    /// Slip (m) of the object in the palm; `None` if the object was not held.
    pub slip: Option<f32>,
}

/// Candidates are ranked by their reach at every tenth coverage pose.
pub(crate) const SPARSE_STEP: usize = 10;

/// Share of pinches among the candidates of a low object.
const PINCH_SHARE: f64 = 0.5;

/// Range of [`SqueezeConfig::max_scale`](super::contact_forces::SqueezeConfig::max_scale) for low objects. A rod of
/// 15 mm and 30 g needs 1 to 3, a flute of 150 g more.
const MAX_SCALE: [f64; 2] = [1.0, 6.0];

/// Number of object poses at which motions into a grasp are planned.
const NUM_APPROACHES: usize = 2;

impl GraspTester<'_> {
    /// Executes a task.
    ///
    /// # Errors
    /// The simulation of a trial cannot be built.
    pub fn execute(&self, task: &Task) -> Result<TaskResult, SceneError> {
        Ok(match task {
            Task::Close { first, count, region } => {
                let (mut candidates, mut rejections) = (Vec::new(), Rejections::default());
                let mut near_misses = Vec::new();
                for index in *first..first + count {
                    match self.close(index, region) {
                        Ok(candidate) => candidates.push(candidate),
                        Err(Rejected { reason, near_miss }) => {
                            rejections.count(reason);
                            near_misses.extend(near_miss);
                        }
                    }
                }
                let best = near_misses.into_iter().min_by(|a, b| a.error.total_cmp(&b.error));
                let near_miss = best.map(|near_miss: Box<NearMiss>| *near_miss);
                TaskResult::Closed { candidates, rejections, near_miss }
            }
            Task::Try { grasp, yaw, trial } => {
                let planned = match yaw {
                    Some(yaw) => PlannedGrasp::plan_at_yaw(&self.at_origin, grasp, *yaw)?,
                    None => PlannedGrasp::plan_at_easiest_yaw(&self.at_origin, grasp)?,
                };
                let try_it = |planned: PlannedGrasp| {
                    let slip = self.try_planned(&planned, *trial)?;
                    Ok::<_, SceneError>(TrialResult { yaw: planned.yaw_index, slip })
                };
                TaskResult::Tried(planned.map(try_it).transpose()?)
            }
            Task::Approach { grasp } => TaskResult::Approached(self.is_approachable(grasp)?),
            Task::Reach { grasp } => {
                let poses = coverage_poses(self.robot);
                TaskResult::Reached(reachability(&self.at_origin, &poses, grasp))
            }
        })
    }

    /// Whether a motion into a grasp is found at the first reachable coverage poses.
    fn is_approachable(&self, grasp: &Grasp) -> Result<bool, SceneError> {
        let mut num_found = 0;
        for pose in coverage_poses(self.robot).iter().step_by(SPARSE_STEP) {
            let placed = self.at_origin.at_pose(pose);
            let Some(posture) = placed.plan(grasp) else { continue };
            if !robustness::has_direct_motion(&placed, &posture)? {
                return Ok(false);
            }
            num_found += 1;
            if num_found == NUM_APPROACHES {
                break;
            }
        }
        Ok(num_found > 0)
    }

    /// Closes the hand at the palm pose of a candidate, or pinches.
    fn close(&self, index: usize, region: &Region) -> Result<ClosedCandidate, Rejected> {
        let (search, mut rng) = (self.config, self.candidate_rng(index));
        let perturb = |palm: &Isometry, rng: &mut ChaCha8Rng| {
            candidates::perturb_palm(palm, search.palm_shift, search.palm_turn, rng)
        };
        let mut config = search.candidate.clone();
        let is_low = self.object.size().z <= pinch::MAX_HEIGHT;
        if is_low {
            let [low, high] = MAX_SCALE.map(libm::log);
            config.squeeze.max_scale = libm::exp(rng.random_range(low..=high));
        }
        let plan = match region {
            Region::AroundPinch(plan) => {
                Some(plan.perturbed(search.palm_shift, search.palm_turn, &mut rng))
            }
            Region::Everywhere if is_low && rng.random_bool(PINCH_SHARE) => {
                Some(PinchPlan::sample(self.robot, self.object, &mut rng))
            }
            _ => None,
        };
        let (grasp, squeeze) = match (&plan, region) {
            (Some(plan), _) => candidates::evaluate_pinch(self.robot, &self.target, &config, plan)?,
            (None, region) => {
                let palm = match region {
                    Region::Around(palm) => perturb(palm, &mut rng),
                    Region::AroundHalfTurn(palm) => {
                        let hand = &self.robot.tree.hand;
                        perturb(&half_turn(hand, self.object, palm), &mut rng)
                    }
                    Region::Everywhere | Region::AroundPinch(_) => {
                        candidates::sample_palm(self.object, &config, &mut rng)
                    }
                };
                self.close_at(palm, &config, &mut rng)?
            }
        };
        let poses: Vec<_> = coverage_poses(self.robot).into_iter().step_by(SPARSE_STEP).collect();
        let sparse_reach = reachability(&self.at_origin, &poses, &grasp);
        let force_margin = squeeze.force_margin;
        Ok(ClosedCandidate { grasp, pinch: plan, force_margin, sparse_reach })
    }
}
