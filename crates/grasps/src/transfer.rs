//! Grasps of an object carried over to one that is like it: moved with the surface, closed again, and tried.
//!
//! A search of its own would find other grasps for every object. Carried over, objects that look alike are grasped
//! alike, and a policy that has learned some of them may know what to do with the next.

use crate::grasp::Grasp;
use crate::kind::{Scored, half_turn};
use crate::proposal::{self, GRASP_CENTER, ProposalConfig};
use crate::search::{Search, SearchConfig};
use crate::{GraspSet, Robot, cluster, tolerance};
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
/// bottle may not, on a lower one. Of two sides of a kind, one may be found and the other not, by a hair; it is then tried
/// half a turn from the one that was. Without it, low bottles were not grasped at all where the other side is out of
/// reach, far from the robot with their broad side in front, and a policy missed the mustard there.
pub fn transfer(
    robot: &Robot,
    from: &Object,
    set: &GraspSet,
    object: &Object,
    config: &SearchConfig,
    seed: u64,
) -> Result<GraspSet, SceneError> {
    let search = Search::begin(robot, object, config, seed);
    let is_tolerant = set.is_chosen();
    let mut tries = Tries { search, is_tolerant, lifted: 0, reliable: 0, confirmed: [0; 2] };
    let mut found = Vec::new();
    for grasp in &set.grasps {
        let palm = carried(from, object, &grasp.object_from_palm);
        found.push(tries.near(&palm, grasp)?);
    }
    for (i, grasp) in set.grasps.iter().enumerate() {
        let other = found.iter().flatten().find(|other: &&Grasp| other.kind == grasp.kind);
        if let (None, Some(other)) = (&found[i], other) {
            let palm = half_turn(object, &other.object_from_palm);
            found[i] = tries.near(&palm, grasp)?;
        }
    }
    let Tries { search, lifted, reliable, confirmed, .. } = tries;
    let Search { proposed, closed, tried, .. } = search;
    let grasps = found.into_iter().flatten().collect();
    Ok(GraspSet { grasps, proposed, closed, tried, lifted, reliable, confirmed })
}

/// Grasps that are tried on an object, and how many came how far.
struct Tries<'a> {
    search: Search<'a>,
    /// Whether they must bear a hand beside its place.
    is_tolerant: bool,
    lifted: usize,
    reliable: usize,
    confirmed: [usize; 2],
}

impl Tries<'_> {
    /// A grasp like `grasp` with the palm there, or nearly so.
    fn near(&mut self, palm: &Isometry, grasp: &Grasp) -> Result<Option<Grasp>, SceneError> {
        let (robot, object, config) = (self.search.robot, self.search.object, self.search.config);
        let enough = if self.is_tolerant { 2 * ENOUGH } else { ENOUGH };
        let proposal = ProposalConfig { open: grasp.open, ..config.proposal.clone() };
        let mut found: Vec<Scored> = Vec::new();
        for try_ in 0..TRIES {
            if found.len() == enough {
                break;
            }
            let (shift, turn) = (config.palm_shift, config.palm_turn);
            let pose = match try_ {
                0 => *palm,
                _ => proposal::vary_palm(palm, shift, turn, &mut self.search.rng),
            };
            self.search.proposed += 1;
            let Some((closed, _)) = self.search.close(pose, &proposal) else { continue };
            let Some(scored) = self.search.scored(&closed)? else { continue };
            self.lifted += 1;
            if scored.again >= config.least_lifted {
                found.push(scored);
            }
        }
        self.reliable += found.len();
        let far = |scored: &Scored| cluster::distance(palm, &scored.grasp.object_from_palm);
        found.sort_by(|a, b| far(a).total_cmp(&far(b)));
        let mut best: Option<(f64, Grasp)> = None;
        for Scored { grasp: near, .. } in found {
            self.confirmed[0] += 1;
            if !self.search.is_confirmed(&near)?
                || !tolerance::is_approachable(robot, object, &near)?
            {
                continue;
            }
            self.confirmed[1] += 1;
            let share =
                if self.is_tolerant { tolerance::share(robot, object, &near)? } else { 1.0 };
            if share >= tolerance::LEAST && best.as_ref().is_none_or(|(most, _)| share > *most) {
                best = Some((share, Grasp { kind: grasp.kind, ..near }));
            }
            if share >= tolerance::GOOD {
                break;
            }
        }
        Ok(best.map(|(_, grasp)| grasp))
    }
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

    #[test]
    fn where_one_side_is_not_found_it_is_half_a_turn_from_the_other() {
        let robot = Robot::standard().unwrap();
        let object = Object::built_in("sugar_box").unwrap();
        let mut set = built_in("sugar_box").unwrap();
        set.grasps.truncate(1);
        // Nothing is there to close on.
        let mut high = set.grasps[0].clone();
        high.object_from_palm.translation.z += 0.3;
        set.grasps.push(high);
        let config = SearchConfig::paper(&robot);
        let found = transfer(&robot, &object, &set, &object, &config, 0).unwrap();
        let [one, other] = &found.grasps[..] else { panic!("{found:?}") };
        let turned = half_turn(&object, &one.object_from_palm);
        assert!(cluster::distance(&turned, &other.object_from_palm) < crate::kind::OTHER_SIDE);
    }
}
