//! Grasps of an object carried over to one that is like it: moved with the surface, closed again, and tried.
//!
//! A search of its own would find other grasps for every object. Carried over, objects that look alike are grasped
//! alike, and a policy that has learned some of them may know what to do with the next.

use crate::grasp::Grasp;
use crate::kind::{Scored, half_turn};
use crate::proposal::{self, ProposalConfig, Subject, propose};
use crate::search::{Search, SearchConfig};
use crate::{GraspSet, Robot, cluster, tolerance};
use geometry::object::Object;
use geometry::proportions::Proportions;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{ARM, Isometry, Vector, rotation};
use scene::SceneError;

/// Palm poses about the one that is carried over, of which the first reliable ones count.
const TRIES: usize = 40;
/// So many reliable ones (twice as many where they have to be tolerant), of which the nearest to the one that is
/// carried over is taken: of variants that are grasped each a centimetre otherwise, a policy learns nothing that it
/// could do with the next.
const ENOUGH: usize = 3;

/// Tries the grasps `set` of the object `from` on `object`, which has these `proportions` of it; those that are reliable
/// there keep their kinds and order.
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
    proportions: &Proportions,
    config: &SearchConfig,
    seed: u64,
) -> Result<GraspSet, SceneError> {
    let search = Search::begin(robot, object, config, seed);
    let is_tolerant = set.is_chosen();
    let mut tries = Tries { search, is_tolerant, lifted: 0, reliable: 0, confirmed: [0; 2] };
    let mut found = Vec::new();
    for grasp in &set.grasps {
        let palm = carried(robot, from, proportions, grasp);
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
            let around = (config.palm_shift, config.palm_turn);
            let pose = beside(palm, try_, around, &mut self.search.rng);
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

/// A grasp of `from` carried over to `object`, which has these `proportions` of it, and closed there or nearly there; not
/// tried in physics. `None` if the hand collides wherever it is put, or its fingers do not hold.
pub(crate) fn closed_again(
    robot: &Robot,
    from: &Object,
    grasp: &Grasp,
    object: &Object,
    proportions: &Proportions,
) -> Option<Grasp> {
    let (of_search, mut rng) = (SearchConfig::paper(robot), ChaCha8Rng::seed_from_u64(79));
    let config = ProposalConfig { open: grasp.open, ..of_search.proposal };
    let palm = carried(robot, from, proportions, grasp);
    let subject = Subject::new(object, &robot.config);
    (0..TRIES).find_map(|try_| {
        let palm = beside(&palm, try_, (of_search.palm_shift, of_search.palm_turn), &mut rng);
        propose(robot, &subject, &config, palm, &mut rng).ok().map(|(grasp, _)| grasp)
    })
}

/// The palm pose of a try: the first is `palm` itself, others lie up to `shift` (m) and `turn` (rad) beside it.
fn beside(
    palm: &Isometry,
    try_: usize,
    (shift, turn): (f64, f64),
    rng: &mut ChaCha8Rng,
) -> Isometry {
    if try_ == 0 { *palm } else { proposal::vary_palm(palm, shift, turn, rng) }
}

/// Where the palm of a grasp of `from` comes when what it holds takes these proportions: it moves as the surface does
/// between the fingertips and the thumb.
///
/// Not as the middle of the hand does: from above that is over the top, and a bottle's shoulder sinks where its top does
/// not.
fn carried(robot: &Robot, from: &Object, proportions: &Proportions, grasp: &Grasp) -> Isometry {
    let held = held(robot, grasp);
    let place = proportions.place(rotation::to_vec3(&held), from.bounds[1].z);
    let shift = rotation::to_vector(place) - held;
    Isometry::translation(shift.x, shift.y, shift.z) * grasp.object_from_palm
}

/// The middle between the fingertips and the thumb's where they touch (m, the object's frame).
fn held(robot: &Robot, grasp: &Grasp) -> Vector {
    let kinematics = robot.tree.kinematics(&robot::join(&[0.0; ARM], &grasp.touch));
    let object_from_world = grasp.object_from_palm * kinematics.palm().inverse();
    let [fingers @ .., thumb] = kinematics.tips();
    let fingers = fingers.iter().sum::<Vector>() / fingers.len() as f64;
    object_from_world.transform_point(&((fingers + thumb) / 2.0).into()).coords
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in::built_in;
    use geometry::Vec3;

    #[test]
    fn a_palm_moves_with_the_surface_that_its_fingers_hold() {
        let robot = Robot::standard().unwrap();
        let bleach = Object::built_in("bleach").unwrap();
        let grasps = built_in("bleach").unwrap().grasps;
        let down = |proportions: &Proportions, grasp: &Grasp| {
            let moved = carried(&robot, &bleach, proportions, grasp);
            assert_eq!(moved.rotation, grasp.object_from_palm.rotation);
            grasp.object_from_palm.translation.vector - moved.translation.vector
        };
        let same = Proportions { scale: Vec3::ONE, sink: 0.0 };
        let sunk = Proportions { sink: 0.2, ..same };
        let half = Proportions { scale: Vec3::splat(0.5), ..same };
        for grasp in &grasps {
            assert!(down(&same, grasp).norm() < 1e-7);
            let by = down(&half, grasp);
            assert!((by - held(&robot, grasp) / 2.0).norm() < 1e-7, "{by}");
            // Nothing sinks by more than the shoulder.
            let by = down(&sunk, grasp);
            assert!(by.xy().norm() < 1e-7 && (0.005..0.0502).contains(&by.z), "{by}");
        }
        // From above, the palm is over the top; what its fingers hold is not.
        let height = |grasp: &&Grasp| grasp.object_from_palm.translation.z;
        let above = grasps.iter().max_by(|a, b| height(a).total_cmp(&height(b))).unwrap();
        let top = f64::from(bleach.bounds[1].z);
        assert!(above.object_from_palm.translation.z > top && held(&robot, above).z < top);
    }

    #[test]
    fn a_grasp_that_is_carried_to_its_own_object_closes_on_the_same_place() {
        let robot = Robot::standard().unwrap();
        let object = Object::built_in("bleach").unwrap();
        let same = Proportions { scale: Vec3::ONE, sink: 0.0 };
        for grasp in &built_in("bleach").unwrap().grasps {
            let again = closed_again(&robot, &object, grasp, &object, &same).unwrap();
            let off = cluster::distance(&again.object_from_palm, &grasp.object_from_palm);
            println!("kind {}: {off} m", grasp.kind);
            assert!(off < 0.03, "{off} m");
        }
        // Far beside it, nothing is there to close on.
        let mut away = built_in("bleach").unwrap().grasps[0].clone();
        away.object_from_palm.translation.z += 0.3;
        assert!(closed_again(&robot, &object, &away, &object, &same).is_none());
    }

    #[test]
    fn a_variant_is_grasped_as_its_object_is() {
        let robot = Robot::standard().unwrap();
        let [from, to] = ["sugar_box", "sugar_box.1"].map(|name| Object::built_in(name).unwrap());
        let proportions = Proportions::of_variant(1);
        let mut set = built_in("sugar_box").unwrap();
        set.grasps.truncate(2);
        let config = SearchConfig::paper(&robot);
        let found = transfer(&robot, &from, &set, &to, &proportions, &config, 0).unwrap();
        let kinds = |set: &GraspSet| set.grasps.iter().map(|g| g.kind).collect::<Vec<_>>();
        assert_eq!(kinds(&found), kinds(&set), "{found:?}");
        for (old, new) in set.grasps.iter().zip(&found.grasps) {
            let turned = rotation::angle_between(
                &old.object_from_palm.rotation,
                &new.object_from_palm.rotation,
            );
            assert!(turned < 1e-9, "turned by {turned} rad");
            let wanted = carried(&robot, &from, &proportions, old);
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
        let same = Proportions { scale: Vec3::ONE, sink: 0.0 };
        let found = transfer(&robot, &object, &set, &object, &same, &config, 0).unwrap();
        let [one, other] = &found.grasps[..] else { panic!("{found:?}") };
        let turned = half_turn(&object, &one.object_from_palm);
        assert!(cluster::distance(&turned, &other.object_from_palm) < crate::kind::OTHER_SIDE);
    }
}
