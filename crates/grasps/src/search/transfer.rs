//! Transfer of grasps to a similar object: move the palm with the surface, close the hand again, test in
//! physics.
//!
//! Separate searches would find different grasps for each object. With transfer, similar objects get similar
//! grasps, and a policy can generalise from some of them to the next.

use crate::search::candidates::{self, CandidateConfig, SearchTarget, evaluate_candidate};
use crate::search::robustness;
use crate::search::{Search, SearchConfig};
use crate::set::clusters::{ScoredGrasp, half_turn};
use crate::set::grasp::Grasp;
use crate::set::k_medoids;
use crate::{GraspSet, RobotContext};
use objects::object::Object;
use objects::shape_variant::ShapeVariant;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{ARM_DOF, Isometry, Vector, rotation};
use scene::SceneError;

/// Maximum number of palm poses around the transferred one; the search stops at the first robust grasps.
const MAX_TRIES: usize = 40;
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
    let search = Search::new(robot, object, config, seed);
    let is_curated = set.is_curated();
    let mut tries = TransferSearch {
        search,
        is_curated,
        num_lifted: 0,
        num_robust: 0,
        full_robot_confirmed: [0; 2],
    };
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
    let TransferSearch { search, num_lifted, num_robust, full_robot_confirmed, .. } = tries;
    let Search { num_candidates, num_closed, num_tried, .. } = search;
    let grasps = found.into_iter().flatten().collect();
    Ok(GraspSet {
        grasps,
        num_candidates,
        num_closed,
        num_tried,
        num_lifted,
        num_robust,
        full_robot_confirmed,
    })
}

/// A search for transferred grasps on one object, with its counts.
struct TransferSearch<'a> {
    search: Search<'a>,
    /// Whether grasps must be robust to hand pose error.
    is_curated: bool,
    num_lifted: usize,
    num_robust: usize,
    full_robot_confirmed: [usize; 2],
}

impl TransferSearch<'_> {
    /// Searches for a grasp near the palm pose `palm`, with the pregrasp posture and the cluster of `grasp`.
    fn find_near(&mut self, palm: &Isometry, grasp: &Grasp) -> Result<Option<Grasp>, SceneError> {
        let (robot, object, config) = (self.search.robot, self.search.object, self.search.config);
        let enough = if self.is_curated { 2 * ENOUGH_ROBUST } else { ENOUGH_ROBUST };
        let proposal = CandidateConfig { pregrasp: grasp.pregrasp, ..config.candidate.clone() };
        let mut found: Vec<ScoredGrasp> = Vec::new();
        for index in 0..MAX_TRIES {
            if found.len() == enough {
                break;
            }
            let perturbation = (config.palm_shift, config.palm_turn);
            let pose = perturbed_palm(palm, index, perturbation, &mut self.search.rng);
            self.search.num_candidates += 1;
            let Some((closed, _)) = self.search.close_at(pose, &proposal) else { continue };
            let Some(scored) = self.search.score_grasp(&closed)? else { continue };
            self.num_lifted += 1;
            if scored.repeat_successes >= config.min_repeat_successes {
                found.push(scored);
            }
        }
        self.num_robust += found.len();
        let far =
            |scored: &ScoredGrasp| k_medoids::palm_distance(palm, &scored.grasp.object_from_palm);
        found.sort_by(|a, b| far(a).total_cmp(&far(b)));
        let mut best: Option<(f64, Grasp)> = None;
        for ScoredGrasp { grasp: near, .. } in found {
            self.full_robot_confirmed[0] += 1;
            if !self.search.is_confirmed(&near)?
                || !robustness::is_approachable(robot, object, &near)?
            {
                continue;
            }
            self.full_robot_confirmed[1] += 1;
            let rate =
                if self.is_curated { robustness::success_rate(robot, object, &near)? } else { 1.0 };
            if rate >= robustness::MIN_RATE
                && best.as_ref().is_none_or(|(best_rate, _)| rate > *best_rate)
            {
                best = Some((rate, Grasp { cluster: grasp.cluster, ..near }));
            }
            if rate >= robustness::GOOD_RATE {
                break;
            }
        }
        Ok(best.map(|(_, grasp)| grasp))
    }
}

/// Transfers a grasp of `from` to `object`, a `variant` of it, and closes the hand at
/// or near the transferred palm pose. No trial in physics. `None` if all tried palm poses collide or give no
/// stable grasp.
pub(crate) fn reclose(
    robot: &RobotContext,
    from: &Object,
    grasp: &Grasp,
    object: &Object,
    variant: &ShapeVariant,
) -> Option<Grasp> {
    let (search_config, mut rng) = (SearchConfig::paper(robot), ChaCha8Rng::seed_from_u64(79));
    let config = CandidateConfig { pregrasp: grasp.pregrasp, ..search_config.candidate };
    let palm = transfer_palm(robot, from, variant, grasp);
    let subject = SearchTarget::new(object, &robot.config);
    (0..MAX_TRIES).find_map(|index| {
        let palm = perturbed_palm(
            &palm,
            index,
            (search_config.palm_shift, search_config.palm_turn),
            &mut rng,
        );
        evaluate_candidate(robot, &subject, &config, palm, &mut rng).ok().map(|(grasp, _)| grasp)
    })
}

/// Palm pose of a try: the first is `palm` itself, the others are perturbed by up to `shift` (m) and `turn`
/// (rad).
fn perturbed_palm(
    palm: &Isometry,
    index: usize,
    (shift, turn): (f64, f64),
    rng: &mut ChaCha8Rng,
) -> Isometry {
    if index == 0 { *palm } else { candidates::perturb_palm(palm, shift, turn, rng) }
}

/// Palm pose of a transferred grasp: it moves as the surface does at the midpoint between fingertips and
/// thumb.
///
/// The palm itself is not the reference. In a grasp from above it is over the top, and the shoulder of a
/// bottle drops where its top does not.
fn transfer_palm(
    robot: &RobotContext,
    from: &Object,
    variant: &ShapeVariant,
    grasp: &Grasp,
) -> Isometry {
    let center = grasp_center(robot, grasp);
    let moved = variant.map_point(rotation::to_vec3(&center), from.bounds[1].z);
    let shift = rotation::to_vector(moved) - center;
    Isometry::translation(shift.x, shift.y, shift.z) * grasp.object_from_palm
}

/// Midpoint between the mean fingertip and the thumb's tip in the grasp posture (m, object frame).
fn grasp_center(robot: &RobotContext, grasp: &Grasp) -> Vector {
    let kinematics =
        robot.tree.forward_kinematics(&robot::joint_vector(&[0.0; ARM_DOF], &grasp.grasp));
    let object_from_world = grasp.object_from_palm * kinematics.palm_pose().inverse();
    let [fingers @ .., thumb] = kinematics.fingertips();
    let fingers = fingers.iter().sum::<Vector>() / fingers.len() as f64;
    object_from_world.transform_point(&((fingers + thumb) / 2.0).into()).coords
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::set::catalog::catalog_grasps;
    use geometry::Vec3;

    #[test]
    fn palm_moves_with_the_grasped_surface() {
        let robot = RobotContext::standard().unwrap();
        let bleach = Object::from_catalog("bleach").unwrap();
        let grasps = catalog_grasps("bleach").unwrap().grasps;
        let displacement = |variant: &ShapeVariant, grasp: &Grasp| {
            let moved = transfer_palm(&robot, &bleach, variant, grasp);
            assert_eq!(moved.rotation, grasp.object_from_palm.rotation);
            grasp.object_from_palm.translation.vector - moved.translation.vector
        };
        let same = ShapeVariant { scale: Vec3::ONE, shoulder_drop: 0.0 };
        let sunk = ShapeVariant { shoulder_drop: 0.2, ..same };
        let half = ShapeVariant { scale: Vec3::splat(0.5), ..same };
        for grasp in &grasps {
            assert!(displacement(&same, grasp).norm() < 1e-7);
            let drop = displacement(&half, grasp);
            assert!((drop - grasp_center(&robot, grasp) / 2.0).norm() < 1e-7, "{drop}");
            // The displacement does not exceed that of the shoulder.
            let drop = displacement(&sunk, grasp);
            assert!(drop.xy().norm() < 1e-7 && (0.005..0.0502).contains(&drop.z), "{drop}");
        }
        // In a grasp from above, the palm is over the top, and the grasp centre is below it.
        let height = |grasp: &&Grasp| grasp.object_from_palm.translation.z;
        let above = grasps.iter().max_by(|a, b| height(a).total_cmp(&height(b))).unwrap();
        let top = f64::from(bleach.bounds[1].z);
        assert!(above.object_from_palm.translation.z > top && grasp_center(&robot, above).z < top);
    }

    #[test]
    fn reclose_on_same_object_returns_nearly_the_same_palm_pose() {
        let robot = RobotContext::standard().unwrap();
        let object = Object::from_catalog("bleach").unwrap();
        let same = ShapeVariant { scale: Vec3::ONE, shoulder_drop: 0.0 };
        for grasp in &catalog_grasps("bleach").unwrap().grasps {
            let again = reclose(&robot, &object, grasp, &object, &same).unwrap();
            let error = k_medoids::palm_distance(&again.object_from_palm, &grasp.object_from_palm);
            println!("cluster {}: {error} m", grasp.cluster);
            assert!(error < 0.03, "{error} m");
        }
        // Far from the object, the fingers close on nothing.
        let mut away = catalog_grasps("bleach").unwrap().grasps[0].clone();
        away.object_from_palm.translation.z += 0.3;
        assert!(reclose(&robot, &object, &away, &object, &same).is_none());
    }

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
            let turned = rotation::angle_between(
                &old.object_from_palm.rotation,
                &new.object_from_palm.rotation,
            );
            assert!(turned < 1e-9, "rotated by {turned} rad");
            let wanted = transfer_palm(&robot, &from, &variant, old);
            assert!(k_medoids::palm_distance(&wanted, &new.object_from_palm) < 1e-9);
        }
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
