//! Order of the grasps of each object pose, such that similar objects at similar poses are grasped in the same way.
//!
//! A search finds grasps of one object and ranks them by robustness. Two similar objects may then have different
//! first grasps, and a policy that is conditioned on their similar clouds would learn the mean of both. Here each
//! pose prefers, among the grasps that it can reach, the one nearest to the preferred grasps of its neighbours. All
//! poses start from the same target, the median over all poses, and then follow fewer and fewer neighbours.
//!
//! Only grasps that tolerate hand pose error are preferred, where the pose has any: a policy does not reach the grasps
//! of its demonstrations exactly. Grasps of the same object differ: some lift in 8 of 10 trials with an error, others
//! never.

use crate::grasp_options::{Descriptor, GraspOption, PoseOptions, RobotPoints};
use grasps::GraspBranch;
use rayon::prelude::*;

/// Order of the grasps of one object pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct GraspOrder {
    /// Reachable grasps, the preferred one first.
    pub(crate) preferred: Vec<GraspBranch>,
    /// Grasps like those that neighbouring poses prefer, if the first of `preferred` is unlike them.
    pub(crate) of_neighbors: Vec<GraspBranch>,
    /// Preferred grasp of a neighbour, if no grasp of this pose is near the median of the neighbours.
    pub(crate) missing: Option<NeighborGrasp>,
}

/// A grasp of another object pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NeighborGrasp {
    /// Index of the pose.
    pub(crate) pose: usize,
    /// Index of the grasp in the set of that pose's object.
    pub(crate) grasp: usize,
}

/// Numbers of neighbours in each stage, after a first stage with all poses.
const STAGES: [usize; 4] = [64, 32, 16, 8];
/// Number of rounds of each stage.
const ROUNDS: usize = 4;
/// Number of neighbours whose preferred grasps are added ([`GraspOrder::of_neighbors`]).
const NUM_OVERLAPPING: usize = 4;
/// Max. distance (m) of two grasps that are alike, by [`RobotPoints::distance`].
const ALIKE: f32 = 0.04;

/// Number of iterations of a geometric median, and min. distance (m) by which it divides.
const MEDIAN_ITERATIONS: usize = 8;
const MIN_DISTANCE: f32 = 0.005;

/// Max. difference of the success rates of a preferred grasp and of the best grasp of the pose.
const RATE_MARGIN: f32 = 0.2;

/// Orders the grasps of all poses. A grasp is missing at a pose if none is within `tolerance` (m, by
/// [`RobotPoints::distance`]) of the median of its neighbours.
pub(crate) fn order_grasps(poses: &[PoseOptions], tolerance: f32) -> Vec<GraspOrder> {
    let all: Vec<usize> = (0..poses.len()).collect();
    let graspable: Vec<usize> =
        all.iter().copied().filter(|&i| !poses[i].options.is_empty()).collect();
    let neighbors = all.par_iter().map(|&i| nearest(poses, &graspable, i)).collect();
    let tolerant: Vec<Vec<&GraspOption>> = poses.iter().map(tolerant_options).collect();
    let preferred = tolerant.iter().map(|options| options.first().copied()).collect();
    let mut relaxation = Relaxation { poses, tolerant, tolerance, neighbors, preferred };
    for _ in 0..ROUNDS {
        let target = median(relaxation.preferred.iter().flatten().map(|option| &option.points));
        relaxation.follow(|_| target);
    }
    for count in STAGES {
        for _ in 0..ROUNDS {
            let targets: Vec<_> = all.par_iter().map(|&i| relaxation.target(i, count)).collect();
            relaxation.follow(|i| targets[i]);
        }
    }
    all.par_iter().map(|&i| relaxation.order(i)).collect()
}

/// Preferred grasps that approach those of their neighbours.
struct Relaxation<'a> {
    poses: &'a [PoseOptions],
    /// Grasps of each pose that may be preferred.
    tolerant: Vec<Vec<&'a GraspOption>>,
    tolerance: f32,
    /// Other poses, nearest first.
    neighbors: Vec<Vec<usize>>,
    preferred: Vec<Option<&'a GraspOption>>,
}

impl<'a> Relaxation<'a> {
    /// Each pose prefers the grasp nearest to its target.
    fn follow(&mut self, target: impl Fn(usize) -> Option<RobotPoints>) {
        for (i, preferred) in self.preferred.iter_mut().enumerate() {
            if let Some(target) = target(i) {
                let distance = |option: &GraspOption| option.points.distance(&target);
                let options = self.tolerant[i].iter().copied();
                *preferred = options.min_by(|a, b| distance(a).total_cmp(&distance(b)));
            }
        }
    }

    /// Preferred grasps of the nearest `count` poses.
    fn of_neighbors(
        &self,
        pose: usize,
        count: usize,
    ) -> impl Iterator<Item = (usize, &'a GraspOption)> + Clone {
        let near = self.neighbors[pose].iter().take(count);
        near.filter_map(|&other| Some((other, self.preferred[other]?)))
    }

    /// Median of the preferred grasps of the nearest `count` poses.
    fn target(&self, pose: usize, count: usize) -> Option<RobotPoints> {
        median(self.of_neighbors(pose, count).map(|(_, option)| &option.points))
    }

    fn order(&self, pose: usize) -> GraspOrder {
        let count = STAGES[STAGES.len() - 1];
        let Some(target) = self.target(pose, count) else {
            let only = self.poses[pose].options.iter().map(|option| option.branch);
            return GraspOrder { preferred: only.collect(), ..GraspOrder::default() };
        };
        let distance = |option: &GraspOption| option.points.distance(&target);
        let by_distance = |a: &&GraspOption, b: &&GraspOption| distance(a).total_cmp(&distance(b));
        let mut options = self.tolerant[pose].clone();
        options.sort_by(by_distance);
        let mut of_neighbors: Vec<&GraspOption> = Vec::new();
        for (_, near) in self.of_neighbors(pose, NUM_OVERLAPPING) {
            let is_alike = |option: &&&GraspOption| option.points.distance(&near.points) < ALIKE;
            let mut known = options.first().into_iter().chain(&of_neighbors);
            if !known.any(|option| is_alike(&option)) {
                of_neighbors.extend(options.iter().find(is_alike).copied());
            }
        }
        let is_missing = options.first().is_none_or(|first| distance(first) > self.tolerance);
        let mut others = self.of_neighbors(pose, count).collect::<Vec<_>>();
        others.sort_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
        let nearest = others.first().filter(|_| is_missing);
        let mut others_here: Vec<&GraspOption> = self.poses[pose].options.iter().collect();
        others_here.retain(|option| !options.contains(option));
        others_here.sort_by(by_distance);
        options.extend(others_here);
        let branches =
            |options: &[&GraspOption]| options.iter().map(|option| option.branch).collect();
        GraspOrder {
            preferred: branches(&options),
            of_neighbors: branches(&of_neighbors),
            missing: nearest
                .map(|(pose, option)| NeighborGrasp { pose: *pose, grasp: option.branch.grasp }),
        }
    }
}

/// Grasps of a pose that tolerate hand pose error about as well as the best of them.
fn tolerant_options(pose: &PoseOptions) -> Vec<&GraspOption> {
    let best = pose.options.iter().map(|option| option.success_rate).fold(0.0, f32::max);
    let is_tolerant = |option: &&GraspOption| option.success_rate >= best - RATE_MARGIN;
    pose.options.iter().filter(is_tolerant).collect()
}

/// The nearest other poses with options, as many as the first of [`STAGES`], nearest first.
fn nearest(poses: &[PoseOptions], graspable: &[usize], of: usize) -> Vec<usize> {
    let squared = |a: &Descriptor, b: &Descriptor| -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
    };
    let others = graspable.iter().filter(|&&i| i != of);
    let mut others: Vec<(f32, usize)> =
        others.map(|&i| (squared(&poses[i].descriptor, &poses[of].descriptor), i)).collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0));
    others.into_iter().take(STAGES[0]).map(|(_, i)| i).collect()
}

/// Geometric median: of two groups of grasps, it lies near the larger one, not between them.
fn median<'a>(all: impl Iterator<Item = &'a RobotPoints> + Clone) -> Option<RobotPoints> {
    all.clone().next()?;
    let mut median = RobotPoints::mean(all.clone().map(|points| (1.0, points)));
    for _ in 0..MEDIAN_ITERATIONS {
        let weight = |points: &RobotPoints| 1.0 / points.distance(&median).max(MIN_DISTANCE);
        median = RobotPoints::mean(all.clone().map(|points| (weight(points), points)));
    }
    Some(median)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pose at a position on a line of shapes, with grasps at these positions (m).
    fn pose(at: f32, grasps: &[f32]) -> PoseOptions {
        let mut descriptor = Descriptor::default();
        descriptor[2] = at;
        let option = |(grasp, x): (usize, &f32)| GraspOption {
            branch: GraspBranch { ik_seed: 0, grasp },
            success_rate: 0.5,
            points: RobotPoints([[*x, 0.0, 0.0]; _]),
        };
        PoseOptions { descriptor, options: grasps.iter().enumerate().map(option).collect() }
    }

    fn first(order: &GraspOrder) -> usize {
        order.preferred[0].grasp
    }

    #[test]
    fn similar_poses_prefer_the_same_grasp_whatever_their_first_grasp() {
        // The grasps are near -0.1 and 0.1; which of them comes first alternates.
        let poses: Vec<PoseOptions> = (0..200)
            .map(|i| {
                let offset = 0.0001 * (i * 37 % 100) as f32;
                let [left, right] = [-0.1 - offset, 0.1 + 0.5 * offset];
                let grasps = if i % 3 == 0 { [right, left] } else { [left, right] };
                pose(0.001 * i as f32, &grasps)
            })
            .collect();
        let orders = order_grasps(&poses, ALIKE);
        let side =
            |(i, order): (usize, &GraspOrder)| poses[i].options[first(order)].points.0[0][0] > 0.0;
        let right = orders.iter().enumerate().filter(|pair| side(*pair)).count();
        assert!(right == 0 || right == 200, "{right} of 200 from the right");
        assert!(orders.iter().all(|order| order.of_neighbors.is_empty()));
        assert!(orders.iter().all(|order| order.preferred.len() == 2));
    }

    #[test]
    fn poses_where_the_preference_changes_have_both_grasps() {
        // Poses below 0.1 reach the left grasp only, those above 0.11 the right one only.
        let reach = |i: usize| match i {
            0..100 => vec![-0.1],
            100..110 => vec![-0.1, 0.1],
            _ => vec![0.1],
        };
        let poses: Vec<PoseOptions> = (0..200).map(|i| pose(0.001 * i as f32, &reach(i))).collect();
        let orders = order_grasps(&poses, ALIKE);
        // With fewer neighbours on the other side, no grasp is missing.
        assert!(orders[..90].iter().chain(&orders[120..]).all(|order| order.missing.is_none()));
        let both: Vec<usize> = (0..200).filter(|&i| !orders[i].of_neighbors.is_empty()).collect();
        assert!(!both.is_empty() && both.iter().all(|i| (100..110).contains(i)), "{both:?}");
    }

    #[test]
    fn pose_with_another_grasp_misses_that_of_its_neighbors() {
        let grasps = |i: usize| if i == 50 { [0.1] } else { [-0.1] };
        let poses: Vec<PoseOptions> =
            (0..100).map(|i| pose(0.001 * i as f32, &grasps(i))).collect();
        let orders = order_grasps(&poses, ALIKE);
        let missing: Vec<usize> = (0..100).filter(|&i| orders[i].missing.is_some()).collect();
        assert_eq!(missing, [50]);
        let neighbor = orders[50].missing.unwrap();
        assert!(neighbor.pose.abs_diff(50) <= 8 && neighbor.grasp == 0, "{neighbor:?}");
    }

    #[test]
    fn poses_prefer_grasps_that_tolerate_errors() {
        // The left grasp fails under hand pose error at every third pose.
        let poses: Vec<PoseOptions> = (0..90)
            .map(|i| {
                let mut pose = pose(0.001 * i as f32, &[-0.1, 0.1]);
                if i % 3 == 0 {
                    pose.options[0].success_rate = 0.1;
                }
                pose
            })
            .collect();
        let orders = order_grasps(&poses, ALIKE);
        for (i, order) in orders.iter().enumerate() {
            assert!(i % 3 > 0 || first(order) == 1, "pose {i}");
            assert_eq!(order.preferred.len(), 2, "the other grasp is kept as the last one");
        }
    }

    #[test]
    fn pose_without_a_reachable_grasp_has_no_order() {
        let poses = [pose(0.0, &[]), pose(0.1, &[0.0]), pose(0.2, &[])];
        let orders = order_grasps(&poses, ALIKE);
        assert!(orders[0].preferred.is_empty() && orders[0].of_neighbors.is_empty());
        // The grasp of the only other pose is missing.
        assert_eq!(orders[0].missing, Some(NeighborGrasp { pose: 1, grasp: 0 }));
        assert_eq!((orders[1].preferred.len(), orders[1].missing), (1, None));
        assert_eq!(order_grasps(&[], ALIKE), []);
    }
}
