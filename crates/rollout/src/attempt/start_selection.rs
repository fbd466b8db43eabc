//! Selection of the start configuration by a forecast.
//!
//! The policy is rolled out without physics from several start configurations. The attempt uses the one from which the
//! fingertips end nearest to the observed surface.
//!
//! *Departure: the paper uses the nearest start configuration (§III-F). Where similar objects are grasped in different
//! ways, the start decides which of the grasps the policy approaches, and not each of them suits the object.*

use crate::attempt::setup::sample_start_target;
use crate::rollout_context::RolloutContext;
use geometry::Vec3;
use objects::object::Object;
use policy::kinematic_rollout::roll_out;
use policy::{Model, Observation};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{Isometry, JointVector, KinematicTree, rotation};

/// Start configuration (rad) of an attempt; `None` if the model has none. `cloud` (m) and the palm pose `target` are in
/// the base frame.
pub(crate) fn select_start(
    model: &Model,
    tree: &KinematicTree,
    observation: &Observation,
    cloud: &[Vec3],
    target: &Isometry,
) -> Option<JointVector> {
    let candidates = model.start_model.find_candidates(observation, target, model.start_candidates);
    if candidates.len() < 2 {
        return candidates.first().copied();
    }
    let starts: Vec<_> = candidates.iter().map(|start| (observation, *start)).collect();
    let ends = roll_out(&model.network, tree, &starts);
    let distance = |end: Option<JointVector>| {
        end.map_or(f64::INFINITY, |end| fingertip_distance(tree, &end, cloud))
    };
    let rated = candidates.into_iter().zip(ends.into_iter().map(distance));
    rated.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(start, _)| start)
}

/// Final configurations (rad, base frame) of the model's policy at poses of an object, each with its cloud (m, base
/// frame): kinematic rollouts from the nearest start configurations. At a pose on which the model was trained, this is the
/// start of the pose itself. `None` without a model, for a cloud without points, and where the policy diverges.
///
/// Poses of the object: x, y (m), yaw (rad). From them, desired palm poses of the start are sampled, as in an attempt.
pub fn policy_ends(
    context: &RolloutContext,
    object: &Object,
    poses: &[([f32; 3], Vec<Vec3>)],
) -> Vec<Option<JointVector>> {
    let (robot, Some(model)) = (&context.robot, &context.model) else {
        return vec![None; poses.len()];
    };
    let start = |([x, y, yaw], cloud): &([f32; 3], Vec<Vec3>)| {
        let observation = model.observe(cloud)?;
        let world_from_object = robot.config.object_pose(*x, *y, *yaw);
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let target = sample_start_target(robot, object, &world_from_object, &mut rng);
        let start = model.start_model.find(&observation, &target)?;
        Some((observation, start))
    };
    let starts: Vec<_> = poses.iter().map(start).collect();
    let found: Vec<_> = starts.iter().flatten().map(|(of, start)| (of, *start)).collect();
    let mut ends = roll_out(&model.network, &robot.tree, &found).into_iter();
    starts.iter().map(|start| start.as_ref().and_then(|_| ends.next().flatten())).collect()
}

/// Distance (m) between a fingertip at `q` and the nearest point of a cloud (base frame), mean over the fingertips.
fn fingertip_distance(tree: &KinematicTree, q: &JointVector, cloud: &[Vec3]) -> f64 {
    let fingertips = tree.forward_kinematics(q).fingertips();
    let nearest = |tip: &robot::Vector| {
        let squares = cloud.iter().map(|point| rotation::to_vec3(tip).distance_squared(*point));
        f64::from(squares.fold(f32::INFINITY, f32::min).sqrt())
    };
    fingertips.iter().map(nearest).sum::<f64>() / fingertips.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn default_model(tree: &KinematicTree) -> Model {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/default");
        let read = |name: &str| std::fs::read(format!("{folder}/{name}")).unwrap();
        let [weights, starts, config] = policy::model::MODEL_FILES.map(|(_, file)| read(file));
        Model::load(&weights, &starts, &config, tree).unwrap()
    }

    /// Front and top of a box in front of the robot (m).
    fn cloud() -> Vec<Vec3> {
        let point = |i: usize| {
            let [y, s] = [i % 16, i / 16].map(|k| k as f32 / 16.0);
            match s < 1.0 {
                true => Vec3::new(0.55, 0.12 * y - 0.06, -0.25 + 0.15 * s),
                false => Vec3::new(0.45 + 0.1 * s, 0.12 * y - 0.06, -0.1),
            }
        };
        (0..512).map(point).collect()
    }

    #[test]
    fn selected_start_leads_nearest_to_the_observed_surface() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let mut model = default_model(&tree);
        let observation = model.observe(&cloud()).unwrap();
        let q = robot::joint_vector(&tree.hand.arm.nominal, &[0.3; robot::HAND_DOF]);
        let target = tree.forward_kinematics(&q).palm_pose();
        let select = |model: &Model| select_start(model, &tree, &observation, &cloud(), &target);
        assert_eq!(select(&model), model.start_model.find(&observation, &target));

        let candidates = model.start_model.find_candidates(&observation, &target, 6);
        assert_eq!(Some(candidates[0]), model.start_model.find(&observation, &target));
        let starts: Vec<_> = candidates.iter().map(|start| (&observation, *start)).collect();
        let ends = roll_out(&model.network, &tree, &starts);
        let distances: Vec<f64> =
            ends.iter().map(|end| fingertip_distance(&tree, &end.unwrap(), &cloud())).collect();
        let best = (0..6).min_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap();
        model.start_candidates = 6;
        assert_eq!(select(&model), Some(candidates[best]), "{distances:?}");
        // The rollout of a start does not depend on the other starts.
        let alone = roll_out(&model.network, &tree, &starts[best..=best]);
        assert_eq!(alone[0], ends[best]);
    }

    #[test]
    fn fingertip_distance_is_the_mean_over_the_fingertips() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let q = JointVector::repeat(0.3);
        let tips = tree.forward_kinematics(&q).fingertips();
        let mut cloud: Vec<Vec3> = tips.iter().map(rotation::to_vec3).collect();
        assert!(fingertip_distance(&tree, &q, &cloud) < 1e-6);
        cloud.iter_mut().for_each(|point| point.z += 0.01);
        assert!((fingertip_distance(&tree, &q, &cloud) - 0.01).abs() < 1e-5);
        assert_eq!(fingertip_distance(&tree, &q, &[]), f64::INFINITY);
    }
}
