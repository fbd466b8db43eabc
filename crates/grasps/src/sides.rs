//! Round objects: the same grasp from every side.
//!
//! What is round looks the same at every yaw. Were it grasped from a side that turns with it, one cloud would call for
//! as many grasps as there are yaws, and a policy that sees no more than the cloud would learn their mean. With all
//! sides at hand, the one is taken that the arm reaches with the least motion, whatever the yaw.

use crate::grasp::Grasp;
use geometry::object::Object;
use geometry::symmetry;
use robot::rotation;

/// The grasps of an object, those of a round or square one from all sides, kind by kind.
///
/// Half turns are not made here: few boxes are so even that a grasp need not be tried from both sides
/// ([`crate::kind`]).
pub fn all_sides(object: &Object, grasps: &[Grasp]) -> Vec<Grasp> {
    let order = symmetry::order(object);
    if order <= 2 {
        return grasps.to_vec();
    }
    let is_first = |i: &usize| *i == 0 || grasps[*i].kind != grasps[i - 1].kind;
    let first = (0..grasps.len()).filter(is_first).map(|i| &grasps[i]);
    first
        .flat_map(|grasp| {
            (0..order).map(|side| {
                let turn = std::f64::consts::TAU * side as f64 / order as f64;
                let object_from_palm = rotation::about_vertical(turn) * grasp.object_from_palm;
                Grasp { object_from_palm, ..grasp.clone() }
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::{HAND, Isometry};

    fn grasp(kind: usize, x: f64) -> Grasp {
        let [open, touch, squeeze] = [[0.0; HAND]; 3];
        Grasp { kind, object_from_palm: Isometry::translation(x, 0.0, 0.1), open, touch, squeeze }
    }

    #[test]
    fn a_can_is_grasped_from_all_sides_and_a_box_from_those_that_were_tried() {
        let grasps = [grasp(0, 0.1), grasp(0, -0.1), grasp(1, 0.2)];
        let can = all_sides(&Object::built_in("soup_can").unwrap(), &grasps);
        assert_eq!(can.len(), 2 * symmetry::ROUND);
        assert!(can.iter().map(|grasp| grasp.kind).is_sorted());
        let distances = can.iter().map(|g| g.object_from_palm.translation.vector.xy().norm());
        for (distance, wanted) in distances.zip([0.1; 24].into_iter().chain([0.2; 24])) {
            assert!((distance - wanted).abs() < 1e-9);
        }
        assert_eq!(all_sides(&Object::built_in("sugar_box").unwrap(), &grasps).len(), 3);
        assert!(all_sides(&Object::built_in("soup_can").unwrap(), &[]).is_empty());
    }
}
