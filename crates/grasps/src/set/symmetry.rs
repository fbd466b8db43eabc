//! Grasps of rotationally symmetric objects, replicated about the vertical axis.
//!
//! A round object produces the same point cloud at every yaw. With a grasp that is fixed to the object, one
//! cloud would require as many grasps as there are yaws, and a policy conditioned on the cloud would learn
//! their mean. With replicated grasps, planning selects the one that needs the least arm motion,
//! independently of the yaw.

use crate::set::grasp::Grasp;
use objects::object::Object;
use objects::symmetry;
use robot::rotation;

/// Replicates the first grasp of each cluster over the symmetry order of the object, in order of the
/// clusters.
///
/// Returns the grasps unchanged up to order 2. Most boxes are not exactly symmetric under a half turn, so
/// both sides are tried in physics instead ([`crate::set::clusters`]).
pub fn expand_by_symmetry(object: &Object, grasps: &[Grasp]) -> Vec<Grasp> {
    let order = symmetry::symmetry_order(object);
    if order <= 2 {
        return grasps.to_vec();
    }
    let is_first = |i: &usize| *i == 0 || grasps[*i].cluster != grasps[i - 1].cluster;
    let first = (0..grasps.len()).filter(is_first).map(|i| &grasps[i]);
    first
        .flat_map(|grasp| {
            (0..order).map(|side| {
                let turn = std::f64::consts::TAU * side as f64 / order as f64;
                let object_from_palm = rotation::rotation_z(turn) * grasp.object_from_palm;
                Grasp { object_from_palm, ..grasp.clone() }
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::{HAND_DOF, Isometry};

    fn grasp(kind: usize, x: f64) -> Grasp {
        let [open, touch, squeeze] = [[0.0; HAND_DOF]; 3];
        Grasp {
            cluster: kind,
            object_from_palm: Isometry::translation(x, 0.0, 0.1),
            pregrasp: open,
            grasp: touch,
            squeeze,
        }
    }

    #[test]
    fn grasps_of_can_are_replicated_and_grasps_of_box_are_not() {
        let grasps = [grasp(0, 0.1), grasp(0, -0.1), grasp(1, 0.2)];
        let can = expand_by_symmetry(&Object::from_catalog("soup_can").unwrap(), &grasps);
        assert_eq!(can.len(), 2 * symmetry::MAX_ORDER);
        assert!(can.iter().map(|grasp| grasp.cluster).is_sorted());
        let distances = can.iter().map(|g| g.object_from_palm.translation.vector.xy().norm());
        for (distance, wanted) in distances.zip([0.1; 24].into_iter().chain([0.2; 24])) {
            assert!((distance - wanted).abs() < 1e-9);
        }
        assert_eq!(
            expand_by_symmetry(&Object::from_catalog("sugar_box").unwrap(), &grasps).len(),
            3
        );
        assert!(expand_by_symmetry(&Object::from_catalog("soup_can").unwrap(), &[]).is_empty());
    }
}
