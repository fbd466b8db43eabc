//! Grasps of an object carried over to one that is like it: moved with the surface, closed again, and tried.
//!
//! A search of its own would find other grasps for every object. Carried over, objects that look alike are grasped
//! alike, and a policy that has learned some of them may know what to do with the next.

use crate::grasp::Grasp;
use crate::proposal::{self, GRASP_CENTER, ProposalConfig};
use crate::search::{Search, SearchConfig};
use crate::{GraspSet, Robot, cluster, kind::Scored, tolerance};
use geometry::object::Object;
use robot::{Isometry, Vector, rotation};
use scene::SceneError;

/// Palm poses about the one that is carried over, of which the first reliable ones count.
const TRIES: usize = 40;
/// So many reliable ones (twice as many where they have to be tolerant), of which the nearest to the one that is
/// carried over is taken: of variants that are grasped each a centimetre otherwise, a policy learns nothing that it
/// could do with the next.
const ENOUGH: usize = 3;

/// Tries the grasps `set` of the object `from` on `object`; those that are reliable there keep their kinds and order.
///
/// Grasps that were chosen by how they bear a hand beside its place must bear it here as well: one above the shoulder of a
/// bottle may not, on a lower one.
pub fn transfer(
    robot: &Robot,
    from: &Object,
    set: &GraspSet,
    object: &Object,
    config: &SearchConfig,
    seed: u64,
) -> Result<GraspSet, SceneError> {
    let mut search = Search::begin(robot, object, config, seed);
    let is_tolerant = set.is_chosen();
    let enough = if is_tolerant { 2 * ENOUGH } else { ENOUGH };
    let (mut grasps, mut lifted, mut reliable, mut confirmed) = (Vec::new(), 0, 0, [0; 2]);
    for grasp in &set.grasps {
        let palm = carried(from, object, &grasp.object_from_palm);
        let proposal = ProposalConfig { open: grasp.open, ..config.proposal.clone() };
        let mut found: Vec<Scored> = Vec::new();
        for try_ in 0..TRIES {
            if found.len() == enough {
                break;
            }
            let (shift, turn) = (config.palm_shift, config.palm_turn);
            let pose = match try_ {
                0 => palm,
                _ => proposal::vary_palm(&palm, shift, turn, &mut search.rng),
            };
            search.proposed += 1;
            let Some((closed, _)) = search.close(pose, &proposal) else { continue };
            let Some(scored) = search.scored(&closed)? else { continue };
            lifted += 1;
            if scored.again >= config.least_lifted {
                found.push(scored);
            }
        }
        reliable += found.len();
        let far = |scored: &Scored| cluster::distance(&palm, &scored.grasp.object_from_palm);
        found.sort_by(|a, b| far(a).total_cmp(&far(b)));
        let mut best: Option<(f64, Grasp)> = None;
        for Scored { grasp: near, .. } in found {
            confirmed[0] += 1;
            if !search.is_confirmed(&near)? || !tolerance::is_approachable(robot, object, &near)? {
                continue;
            }
            confirmed[1] += 1;
            let share = if is_tolerant { tolerance::share(robot, object, &near)? } else { 1.0 };
            if share >= tolerance::LEAST && best.as_ref().is_none_or(|(most, _)| share > *most) {
                best = Some((share, Grasp { kind: grasp.kind, ..near }));
            }
            if share >= tolerance::GOOD {
                break;
            }
        }
        grasps.extend(best.map(|(_, grasp)| grasp));
    }
    let Search { proposed, closed, tried, .. } = search;
    Ok(GraspSet { grasps, proposed, closed, tried, lifted, reliable, confirmed })
}

/// The pose of a palm whose grasp centre has the same place in the bounding box of `object` as in that of `from`.
fn carried(from: &Object, object: &Object, object_from_palm: &Isometry) -> Isometry {
    let size = |object: &Object| rotation::to_vector(object.bounds[1] - object.bounds[0]);
    let factors = size(object).component_div(&size(from));
    let center = object_from_palm.transform_point(&GRASP_CENTER.into()).coords;
    // Boxes are centred in x and y and stand on z = 0: their frames are scaled alike.
    let place: Vector = center.component_mul(&factors);
    let shift = place - center;
    Isometry::translation(shift.x, shift.y, shift.z) * object_from_palm
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in::built_in;

    #[test]
    fn a_palm_keeps_its_place_in_the_bounding_box_and_its_distance() {
        let (from, to) = ("bleach", "bleach.2");
        let [from, to] = [from, to].map(|name| Object::built_in(name).unwrap());
        let palm = &built_in("bleach").unwrap().grasps[0].object_from_palm;
        let moved = carried(&from, &to, palm);
        let share = |object: &Object, palm: &Isometry| {
            let center = palm.transform_point(&GRASP_CENTER.into()).coords;
            center.component_div(&rotation::to_vector(object.bounds[1] - object.bounds[0]))
        };
        assert!((share(&from, palm) - share(&to, &moved)).norm() < 1e-6);
        assert_eq!(moved.rotation, palm.rotation);
        assert!(
            (carried(&from, &from, palm).translation.vector - palm.translation.vector).norm()
                < 1e-12
        );
    }

    #[test]
    fn a_variant_is_grasped_as_its_object_is() {
        let robot = Robot::standard().unwrap();
        let [from, to] = ["sugar_box", "sugar_box.1"].map(|name| Object::built_in(name).unwrap());
        let mut set = built_in("sugar_box").unwrap();
        set.grasps.truncate(2);
        let config = SearchConfig::paper(&robot);
        let found = transfer(&robot, &from, &set, &to, &config, 0).unwrap();
        let kinds = |set: &GraspSet| set.grasps.iter().map(|g| g.kind).collect::<Vec<_>>();
        assert_eq!(kinds(&found), kinds(&set), "{found:?}");
        for (old, new) in set.grasps.iter().zip(&found.grasps) {
            let turned = rotation::angle_between(
                &old.object_from_palm.rotation,
                &new.object_from_palm.rotation,
            );
            assert!(turned < 1e-9, "turned by {turned} rad");
            let wanted = carried(&from, &to, &old.object_from_palm);
            assert!(cluster::distance(&wanted, &new.object_from_palm) < 1e-9);
        }
    }
}
