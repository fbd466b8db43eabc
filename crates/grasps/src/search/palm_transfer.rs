//! Palm pose of a transferred grasp, and kinematic closing of the hand there.

use crate::RobotContext;
use crate::search::SearchConfig;
use crate::search::candidates::{self, CandidateConfig, SearchTarget, evaluate_candidate};
use crate::set::grasp::Grasp;
use objects::object::Object;
use objects::shape_variant::ShapeVariant;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{ARM_DOF, Isometry, Vector, rotation};

/// Maximum number of palm poses around the transferred one; the search stops at the first robust grasps.
pub(super) const MAX_TRIES: usize = 40;

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
pub(super) fn perturbed_palm(
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
pub(super) fn transfer_palm(
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
    use crate::set::k_medoids;
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
}
