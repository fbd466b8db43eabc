//! Kinds of grasps: a grasp and the same one from behind.
//!
//! Boxes and bottles look the same after half a turn. Were a pose answered by one grasp and the pose
//! half a turn away by another, the same cloud would call for two grasps, and a policy that sees no
//! more than the cloud would learn their mean. With both sides of a grasp at hand, both poses are
//! answered by the one that the arm reaches with less motion: the same place in the world.

use crate::cluster;
use crate::grasp::Grasp;
use crate::proposal::GRASP_CENTER;
use geometry::object::Object;
use robot::{Isometry, Vector, rotation};

/// A pose of the palm on the object after half a turn about the vertical through the middle of what
/// it grasps.
pub fn half_turn(object: &Object, object_from_palm: &Isometry) -> Isometry {
    let grasped = object_from_palm.transform_point(&GRASP_CENTER.into());
    let middle = middle_at(object, grasped.z);
    let turn = rotation::about(&Vector::z(), std::f64::consts::PI);
    let about_middle = Isometry::from_parts((middle - turn * middle).into(), turn);
    about_middle * object_from_palm
}

/// The middle of the object's cross-section at a height (m); that of its bounding box beyond its ends.
fn middle_at(object: &Object, height: f64) -> Vector {
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

/// Greatest distance (m, by [`cluster::distance`]) of a grasp from the half turn of its other side.
pub(crate) const OTHER_SIDE: f64 = 0.04;

/// A grasp that lifted, and what more it can.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Scored {
    /// The grasp.
    pub grasp: Grasp,
    /// Repeats, in which the object stood beside its place, that lifted.
    pub again: usize,
    /// How far (m) the object slips in the hand when it is shaken; `None` if it is lost.
    pub shaken: Option<f32>,
}

impl Scored {
    /// How reliable the grasp is, in hundredths of a repeat: one that bears shaking is worth up to [`SHAKING`]
    /// more repeats, the more the less the object slips.
    pub(crate) fn worth(&self) -> usize {
        let firmness = self.shaken.map_or(0.0, |slip| (1.0 - slip / LOOSE).max(0.0));
        100 * self.again + (100.0 * SHAKING * firmness) as usize
    }
}

/// Repeats that the shaking counts for.
const SHAKING: f32 = 10.0;
/// Slip (m) when shaken that is as bad as a loss.
const LOOSE: f32 = 0.02;

/// Clusters reliable grasps into at most `count` kinds and numbers them.
///
/// `reach[i][p]` says whether grasp `i` is in reach at object pose `p`. The first kind serves the most
/// poses, weighted by how reliable it is, each further one the most of those that are left: in this
/// order they are tried.
pub fn kinds(
    object: &Object,
    reliable: &[Scored],
    reach: &[Vec<bool>],
    count: usize,
) -> Vec<Grasp> {
    let poses: Vec<_> = reliable.iter().map(|found| found.grasp.object_from_palm).collect();
    let turned: Vec<_> = poses.iter().map(|pose| half_turn(object, pose)).collect();
    let either_side = |a: usize, b: usize| {
        cluster::distance(&poses[a], &poses[b]).min(cluster::distance(&turned[a], &poses[b]))
    };
    let medoids = cluster::medoids(poses.len(), count, either_side);
    let cluster_of = |i: usize| {
        let nearer = |a: &&usize, b: &&usize| either_side(**a, i).total_cmp(&either_side(**b, i));
        medoids.iter().min_by(nearer).copied()
    };
    let mut free: Vec<usize> = (0..poses.len()).collect();
    let mut clusters = medoids.clone();
    let mut is_served = vec![false; reach.first().map_or(0, Vec::len)];
    let mut grasps = Vec::new();
    while !clusters.is_empty() {
        // Of all grasps of the clusters that are left, each with its other side.
        let sides = free.iter().filter(|&&i| cluster_of(i).is_some_and(|m| clusters.contains(&m)));
        let sides = sides.map(|&i| {
            let far = |j: &usize| cluster::distance(&turned[i], &poses[*j]);
            let others = free.iter().copied().filter(|&j| j != i && far(&j) < OTHER_SIDE);
            (i, others.min_by(|a, b| far(a).total_cmp(&far(b))))
        });
        let serves = |(i, other): &(usize, Option<usize>), pose: usize| {
            reach[*i][pose] || other.is_some_and(|other| reach[other][pose])
        };
        let gain = |sides: &(usize, Option<usize>)| {
            let new = (0..is_served.len()).filter(|&p| !is_served[p] && serves(sides, p)).count();
            let worth = sides.1.map_or(0, |other| reliable[other].worth());
            (new * reliable[sides.0].worth(), worth)
        };
        // Of equals the first.
        let best = sides.rev().max_by_key(gain);
        let Some(best) = best else { break };
        for (pose, is_served) in is_served.iter_mut().enumerate() {
            *is_served |= serves(&best, pose);
        }
        let kind = medoids.len() - clusters.len();
        for side in [Some(best.0), best.1].into_iter().flatten() {
            grasps.push(Grasp { kind, ..reliable[side].grasp.clone() });
            free.retain(|&i| i != side);
        }
        clusters.retain(|&m| Some(m) != cluster_of(best.0));
    }
    grasps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grasp(object_from_palm: Isometry) -> Grasp {
        let hand = [0.0; robot::HAND];
        Grasp { kind: 0, object_from_palm, open: hand, touch: hand, squeeze: hand }
    }

    fn bottle() -> Object {
        Object::built_in("bleach").unwrap()
    }

    #[test]
    fn two_half_turns_lead_back() {
        let pose = Isometry::from_parts(
            Vector::new(0.1, -0.03, 0.2).into(),
            rotation::from_rpy([0.3, -1.0, 2.0]),
        );
        let once = half_turn(&bottle(), &pose);
        assert!((once.translation.vector - pose.translation.vector).norm() > 0.1);
        assert!(cluster::distance(&half_turn(&bottle(), &once), &pose) < 1e-12);
    }

    #[test]
    fn the_kind_that_serves_the_most_poses_comes_first_with_its_other_side() {
        let object = bottle();
        let at = |x: f64, z: f64| Isometry::translation(x, 0.0, z);
        let top = half_turn(&object, &at(0.0, 0.3));
        assert!((middle_at(&object, 0.19).x - middle_at(&object, 0.02).x - 0.0125).abs() < 0.002);
        let scored = |pose, again| Scored { grasp: grasp(pose), again, shaken: None };
        // From one side only; from above, twice nearly the same; from above turned.
        let reliable = [
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
        let grasps = kinds(&object, &reliable, &reach, 2);
        let places: Vec<(usize, f64)> =
            grasps.iter().map(|g| (g.kind, g.object_from_palm.translation.x)).collect();
        assert_eq!(places, [(0, 0.005), (0, top.translation.x), (1, 0.2)]);
        assert!(kinds(&object, &[], &[], 7).is_empty());
    }
}
