//! Transfer of grasps to a similar object: move the palm with the surface, close the hand again, test in
//! physics.
//!
//! Separate searches would find different grasps for each object. With transfer, similar objects get similar
//! grasps, and a policy can generalise from some of them to the next.

use crate::search::candidates::CandidateConfig;
use crate::search::palm_transfer::{MAX_TRIES, perturbed_palm, transfer_palm};
use crate::search::robustness;
use crate::search::tester::Robustness;
use crate::search::{GraspTester, SearchConfig};
use crate::set::clusters::half_turn;
use crate::set::grasp::Grasp;
use crate::set::k_medoids;
use crate::{GraspSet, RobotContext};
use objects::object::Object;
use objects::shape_variant::ShapeVariant;
use robot::Isometry;
use scene::SceneError;

/// Number of robust grasps that suffice; doubled if robustness to hand pose error is required. The one
/// closest to the transferred pose is selected: a policy cannot generalise from variants whose grasps differ
/// by 10 mm.
const ENOUGH_ROBUST: usize = 3;

/// Transfers the grasps `set` of the object `from` to `object`, a `variant` of it.
/// Grasps that are robust there keep their cluster and order.
///
/// Grasps that were selected for their robustness to hand pose error must also be robust here: one above the
/// shoulder of a bottle may not be, on a lower bottle. Of a grasp and its half-turn counterpart, only one may
/// be found, by a narrow margin. The other is then tried half a turn from it. Without this step, low bottles
/// were not grasped at all where the counterpart is unreachable, far from the robot with their broad side in
/// front, and a policy missed the mustard bottle there.
pub fn transfer(
    robot: &RobotContext,
    from: &Object,
    set: &GraspSet,
    object: &Object,
    variant: &ShapeVariant,
    config: &SearchConfig,
    seed: u64,
) -> Result<GraspSet, SceneError> {
    let tester = GraspTester::new(robot, object, config, seed);
    let mut tries = TransferSearch::new(tester, set.is_curated());
    let mut found = Vec::new();
    for grasp in &set.grasps {
        let palm = transfer_palm(robot, from, variant, grasp);
        found.push(tries.find_near(&palm, grasp)?);
    }
    for (i, grasp) in set.grasps.iter().enumerate() {
        let other = found.iter().flatten().find(|other: &&Grasp| other.cluster == grasp.cluster);
        if let (None, Some(other)) = (&found[i], other) {
            let palm = half_turn(&robot.tree.hand, object, &other.object_from_palm);
            found[i] = tries.find_near(&palm, grasp)?;
        }
    }
    Ok(GraspSet { grasps: found.into_iter().flatten().collect(), ..tries.counts })
}

/// Searches for robust grasps of `object` near palm poses (object frame). Each has the pregrasp posture of the grasp
/// next to it, which may be one of another object. The grasps that are found are clusters in the order of the poses.
pub fn adapt(
    robot: &RobotContext,
    object: &Object,
    wanted: &[(Isometry, Grasp)],
    config: &SearchConfig,
    seed: u64,
) -> Result<GraspSet, SceneError> {
    let mut tries = TransferSearch::new(GraspTester::new(robot, object, config, seed), false);
    let mut grasps = Vec::new();
    for (palm, grasp) in wanted {
        let cluster = grasps.len();
        grasps.extend(tries.find_near(palm, &Grasp { cluster, ..grasp.clone() })?);
    }
    Ok(GraspSet { grasps, ..tries.counts })
}

/// A search for transferred grasps on one object, with its counts.
struct TransferSearch<'a> {
    tester: GraspTester<'a>,
    /// Whether grasps must be robust to hand pose error.
    is_curated: bool,
    /// Counts, without grasps.
    counts: GraspSet,
}

impl<'a> TransferSearch<'a> {
    fn new(tester: GraspTester<'a>, is_curated: bool) -> Self {
        let grasps = Vec::new();
        let counts = GraspSet {
            grasps,
            num_candidates: 0,
            num_closed: 0,
            num_tried: 0,
            num_lifted: 0,
            num_robust: 0,
        };
        Self { tester, is_curated, counts }
    }

    /// Searches for a grasp near the palm pose `palm`, with the pregrasp posture and the cluster of `grasp`.
    fn find_near(&mut self, palm: &Isometry, grasp: &Grasp) -> Result<Option<Grasp>, SceneError> {
        let config = self.tester.config;
        let enough = if self.is_curated { 2 * ENOUGH_ROBUST } else { ENOUGH_ROBUST };
        let proposal = CandidateConfig { pregrasp: grasp.pregrasp, ..config.candidate.clone() };
        let mut found: Vec<Grasp> = Vec::new();
        let (mut num_found, mut best) = (0, None);
        for index in 0..MAX_TRIES {
            if num_found == enough {
                break;
            }
            let perturbation = (config.palm_shift, config.palm_turn);
            let mut rng = self.tester.candidate_rng(self.counts.num_candidates);
            let pose = perturbed_palm(palm, index, perturbation, &mut rng);
            self.counts.num_candidates += 1;
            let Ok((closed, _)) = self.tester.close_at(pose, &proposal, &mut rng) else {
                continue;
            };
            if !self.is_robust(&closed)? {
                continue;
            }
            num_found += 1;
            if index > 0 {
                found.push(closed);
                continue;
            }
            // No other palm pose is closer to the transferred one.
            best = self.rate(closed)?;
            if best.as_ref().is_some_and(|(rate, _)| *rate >= robustness::GOOD_RATE) {
                break;
            }
        }
        let far = |grasp: &Grasp| k_medoids::palm_distance(palm, &grasp.object_from_palm);
        found.sort_by(|a, b| far(a).total_cmp(&far(b)));
        for near in found {
            if best.as_ref().is_some_and(|(rate, _)| *rate >= robustness::GOOD_RATE) {
                break;
            }
            if let Some((rate, near)) = self.rate(near)?
                && best.as_ref().is_none_or(|(best_rate, _)| rate > *best_rate)
            {
                best = Some((rate, near));
            }
        }
        Ok(best.map(|(_, near)| Grasp { cluster: grasp.cluster, ..near }))
    }

    /// Whether a closed grasp is robust.
    fn is_robust(&mut self, closed: &Grasp) -> Result<bool, SceneError> {
        self.counts.num_closed += 1;
        let result = self.tester.is_robust(closed)?;
        self.counts.num_tried += usize::from(result.is_some());
        self.counts.num_lifted += usize::from(result >= Some(Robustness::Lifts));
        self.counts.num_robust += usize::from(result == Some(Robustness::Robust));
        Ok(result == Some(Robustness::Robust))
    }

    /// Success rate of a robust grasp under hand pose error, 1 where it is not required; `None` if it is not
    /// usable.
    fn rate(&self, grasp: Grasp) -> Result<Option<(f64, Grasp)>, SceneError> {
        let GraspTester { robot, object, .. } = self.tester;
        if !robustness::is_approachable(robot, object, &grasp)? {
            return Ok(None);
        }
        let rate = if self.is_curated {
            robustness::bounded_success_rate(robot, object, &grasp)?
        } else {
            1.0
        };
        Ok((rate >= robustness::MIN_RATE).then_some((rate, grasp)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::set::catalog::catalog_grasps;
    use geometry::Vec3;

    #[test]
    fn variant_gets_the_clusters_and_palm_poses_of_its_object() {
        let robot = RobotContext::standard().unwrap();
        let [from, to] =
            ["sugar_box", "sugar_box.1"].map(|name| Object::from_catalog(name).unwrap());
        let variant = ShapeVariant::by_number(1);
        let mut set = catalog_grasps("sugar_box").unwrap();
        set.grasps.truncate(2);
        let config = SearchConfig::paper(&robot);
        let found = transfer(&robot, &from, &set, &to, &variant, &config, 0).unwrap();
        let kinds = |set: &GraspSet| set.grasps.iter().map(|g| g.cluster).collect::<Vec<_>>();
        assert_eq!(kinds(&found), kinds(&set), "{found:?}");
        for (old, new) in set.grasps.iter().zip(&found.grasps) {
            let turned = robot::rotation::angle_between(
                &old.object_from_palm.rotation,
                &new.object_from_palm.rotation,
            );
            assert!(turned < 1e-9, "rotated by {turned} rad");
            let wanted = transfer_palm(&robot, &from, &variant, old);
            assert!(k_medoids::palm_distance(&wanted, &new.object_from_palm) < 1e-9);
        }
    }

    #[test]
    fn palm_pose_of_another_object_is_adapted() {
        let robot = RobotContext::standard().unwrap();
        let object = Object::from_catalog("cracker_box").unwrap();
        let other = catalog_grasps("sugar_box").unwrap().grasps.swap_remove(0);
        // The cracker box is taller than the sugar box.
        let sugar_box = Object::from_catalog("sugar_box").unwrap();
        let mut palm = other.object_from_palm;
        palm.translation.z += f64::from(object.bounds[1].z - sugar_box.bounds[1].z);
        let mut far = palm;
        far.translation.z += 0.3;
        let wanted = [(far, other.clone()), (palm, other)];
        let config = SearchConfig::paper(&robot);
        let found = adapt(&robot, &object, &wanted, &config, 0).unwrap();
        let [grasp] = &found.grasps[..] else { panic!("{found:?}") };
        assert!(k_medoids::palm_distance(&palm, &grasp.object_from_palm) < 0.03);
        assert_eq!(grasp.cluster, 0);
    }

    #[test]
    fn missing_counterpart_is_found_half_a_turn_from_the_other_side() {
        let robot = RobotContext::standard().unwrap();
        let object = Object::from_catalog("sugar_box").unwrap();
        let mut set = catalog_grasps("sugar_box").unwrap();
        set.grasps.truncate(1);
        // Far from the object, the fingers close on nothing.
        let mut high = set.grasps[0].clone();
        high.object_from_palm.translation.z += 0.3;
        set.grasps.push(high);
        let config = SearchConfig::paper(&robot);
        let same = ShapeVariant { scale: Vec3::ONE, shoulder_drop: 0.0 };
        let found = transfer(&robot, &object, &set, &object, &same, &config, 0).unwrap();
        let [one, other] = &found.grasps[..] else { panic!("{found:?}") };
        let turned = half_turn(&robot.tree.hand, &object, &one.object_from_palm);
        assert!(
            k_medoids::palm_distance(&turned, &other.object_from_palm)
                < crate::set::clusters::HALF_TURN_TOLERANCE
        );
    }
}
