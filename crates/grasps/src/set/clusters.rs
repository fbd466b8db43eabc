//! Clusters of grasps; each cluster contains a grasp and its half-turn counterpart.
//!
//! Boxes and bottles look the same after half a turn. If a pose had one grasp, and the pose half a turn away
//! had another, the same point cloud would require two grasps. A policy conditioned on the cloud would learn
//! their mean. With both sides of a grasp available, planning selects for both poses the side that needs less
//! arm motion: the same palm pose in the world.

use crate::set::grasp::Grasp;
use crate::set::k_medoids;
use objects::object::Object;
use robot::{HandModel, Isometry, Vector, rotation};

/// The palm pose after half a turn about the vertical axis through the centre of the cross-section that `hand`
/// grasps.
pub fn half_turn(hand: &HandModel, object: &Object, object_from_palm: &Isometry) -> Isometry {
    let grasped = object_from_palm.transform_point(&hand.grasp.center.into());
    let middle = section_center(object, grasped.z);
    let turn = rotation::from_axis_angle(&Vector::z(), std::f64::consts::PI);
    let about_middle = Isometry::from_parts((middle - turn * middle).into(), turn);
    about_middle * object_from_palm
}

/// Centre of the object's cross-section at a height (m); above and below the object, the centre of its
/// bounding box.
fn section_center(object: &Object, height: f64) -> Vector {
    let (mut min, mut max) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
    let mesh = &object.mesh;
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| rotation::to_vector(mesh.vertices[i as usize]));
        for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (corners[a], corners[b])) {
            if (a.z - height) * (b.z - height) < 0.0 {
                let point = a.lerp(&b, (height - a.z) / (b.z - a.z));
                (min, max) = (min.inf(&point), max.sup(&point));
            }
        }
    }
    let middle = if min.x <= max.x { (min + max) * 0.5 } else { Vector::zeros() };
    Vector::new(middle.x, middle.y, 0.0)
}

/// Maximum distance (m, by [`k_medoids::palm_distance`]) between a grasp and the half turn of its
/// counterpart.
pub(crate) const HALF_TURN_TOLERANCE: f64 = 0.04;

/// A grasp that lifted the object, with its scores in further trials.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct ScoredGrasp {
    /// The grasp, in the object's frame.
    pub grasp: Grasp,
    /// Number of repeats that lifted; each displaces the object from the planned pose.
    pub repeat_successes: usize,
    /// Slip (m) of the object in the hand when shaken; `None` if the object was lost.
    pub shake_slip: Option<f32>,
}

impl ScoredGrasp {
    /// Robustness of the grasp, in hundredths of a repeat. A grasp that withstands shaking scores up to
    /// [`SHAKE_BONUS`] more repeats, decreasing with the slip.
    pub(crate) fn score(&self) -> usize {
        let firmness = self.shake_slip.map_or(0.0, |slip| (1.0 - slip / MAX_SHAKE_SLIP).max(0.0));
        100 * self.repeat_successes + (100.0 * SHAKE_BONUS * firmness) as usize
    }
}

/// Repeats that a grasp without slip under shaking scores in addition.
const SHAKE_BONUS: f32 = 10.0;
/// Slip (m) under shaking that scores as a lost object.
pub(crate) const MAX_SHAKE_SLIP: f32 = 0.02;

/// Clusters are selected until they cover this fraction of the poses that any robust grasp covers. The second cluster
/// is selected in any case: the motion into a grasp of the first may not be found.
const SUFFICIENT_COVERAGE: f64 = 0.98;
const MIN_CLUSTERS: usize = 2;

/// Clusters robust grasps into up to `count` clusters and selects one or two grasps of each. Returns the number
/// of the cluster and the index of the grasp, in order of the clusters.
///
/// `reach[i][p]`: whether grasp `i` is reachable at object pose `p`. The first cluster covers the most object
/// poses, weighted by its score; each next one covers the most of the remaining poses. Clusters are tried in
/// this order.
pub fn cluster_grasps(
    hand: &HandModel,
    object: &Object,
    robust: &[ScoredGrasp],
    reach: &[Vec<bool>],
    count: usize,
) -> Vec<(usize, usize)> {
    let poses: Vec<_> = robust.iter().map(|found| found.grasp.object_from_palm).collect();
    let turned: Vec<_> = poses.iter().map(|pose| half_turn(hand, object, pose)).collect();
    let symmetric_distance = |a: usize, b: usize| {
        k_medoids::palm_distance(&poses[a], &poses[b])
            .min(k_medoids::palm_distance(&turned[a], &poses[b]))
    };
    let medoids = k_medoids::k_medoids(poses.len(), count, symmetric_distance);
    let cluster_of = |i: usize| {
        let nearer = |a: &&usize, b: &&usize| {
            symmetric_distance(**a, i).total_cmp(&symmetric_distance(**b, i))
        };
        medoids.iter().min_by(nearer).copied()
    };
    let mut free: Vec<usize> = (0..poses.len()).collect();
    let mut clusters = medoids.clone();
    let mut is_covered = vec![false; reach.first().map_or(0, Vec::len)];
    let num_coverable =
        (0..is_covered.len()).filter(|&pose| reach.iter().any(|reach| reach[pose])).count();
    let mut selected = Vec::new();
    while !clusters.is_empty() {
        // All grasps of the remaining clusters, each with its half-turn counterpart.
        let pairs = free.iter().filter(|&&i| cluster_of(i).is_some_and(|m| clusters.contains(&m)));
        let pairs = pairs.map(|&i| {
            let far = |j: &usize| k_medoids::palm_distance(&turned[i], &poses[*j]);
            let others = free.iter().copied().filter(|&j| j != i && far(&j) < HALF_TURN_TOLERANCE);
            (i, others.min_by(|a, b| far(a).total_cmp(&far(b))))
        });
        let covers = |(i, other): &(usize, Option<usize>), pose: usize| {
            reach[*i][pose] || other.is_some_and(|other| reach[other][pose])
        };
        let gain = |pair: &(usize, Option<usize>)| {
            let new = (0..is_covered.len()).filter(|&p| !is_covered[p] && covers(pair, p)).count();
            let counterpart_score = pair.1.map_or(0, |other| robust[other].score());
            (new * robust[pair.0].score(), counterpart_score)
        };
        // Ties select the first.
        let best = pairs.rev().max_by_key(gain);
        let Some(best) = best else { break };
        let num_covered = is_covered.iter().filter(|covered| **covered).count();
        let is_enough = num_covered as f64 >= SUFFICIENT_COVERAGE * num_coverable as f64;
        if is_enough && clusters.len() + MIN_CLUSTERS <= medoids.len() {
            break;
        }
        for (pose, is_covered) in is_covered.iter_mut().enumerate() {
            *is_covered |= covers(&best, pose);
        }
        let cluster = medoids.len() - clusters.len();
        for side in [Some(best.0), best.1].into_iter().flatten() {
            selected.push((cluster, side));
            free.retain(|&i| i != side);
        }
        clusters.retain(|&m| Some(m) != cluster_of(best.0));
    }
    selected
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grasp(object_from_palm: Isometry) -> Grasp {
        let hand = [0.0; robot::HAND_DOF];
        Grasp { cluster: 0, object_from_palm, pregrasp: hand, grasp: hand, squeeze: hand }
    }

    fn bottle() -> Object {
        Object::from_catalog("bleach").unwrap()
    }

    #[test]
    fn two_half_turns_are_the_identity() {
        let pose = Isometry::from_parts(
            Vector::new(0.1, -0.03, 0.2).into(),
            rotation::from_rpy([0.3, -1.0, 2.0]),
        );
        let hand = HandModel::standard();
        let once = half_turn(hand, &bottle(), &pose);
        assert!((once.translation.vector - pose.translation.vector).norm() > 0.1);
        assert!(k_medoids::palm_distance(&half_turn(hand, &bottle(), &once), &pose) < 1e-12);
    }

    #[test]
    fn cluster_with_most_covered_poses_comes_first_with_its_counterpart() {
        let object = bottle();
        let at = |x: f64, z: f64| Isometry::translation(x, 0.0, z);
        let hand = HandModel::standard();
        let top = half_turn(hand, &object, &at(0.0, 0.3));
        assert!(
            (section_center(&object, 0.19).x - section_center(&object, 0.02).x - 0.0125).abs()
                < 0.002
        );
        let scored = |pose, again| ScoredGrasp {
            grasp: grasp(pose),
            repeat_successes: again,
            shake_slip: None,
        };
        // Lateral, without counterpart; two similar grasps from above; from above, half a turn away.
        let robust = [
            scored(at(0.2, 0.1), 8),
            scored(at(0.0, 0.3), 7),
            scored(at(0.005, 0.3), 8),
            scored(top, 7),
        ];
        let reach = [
            vec![true, true, false, false, false],
            vec![true, true, false, false, false],
            vec![true, true, false, false, false],
            vec![false, false, true, true, false],
        ];
        let selected = cluster_grasps(hand, &object, &robust, &reach, 2);
        assert_eq!(selected, [(0, 2), (0, 3), (1, 0)]);
        assert!(cluster_grasps(hand, &object, &[], &[], 7).is_empty());
    }
}
