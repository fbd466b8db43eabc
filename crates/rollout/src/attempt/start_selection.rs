//! Selection of the start configuration by a forecast.
//!
//! The policy is rolled out without physics from several start configurations. The attempt uses the one from which the
//! fingertips end nearest to the observed surface.
//!
//! *Departure: the paper uses the nearest start configuration (§III-F). Where similar objects are grasped in different
//! ways, the start decides which of the grasps the policy approaches, and not each of them suits the object.*

use geometry::Vec3;
use policy::{Model, Observation};
use robot::{Isometry, JointState, JointVector, KinematicTree, integrator, rotation};
use scene::config::CONTROL_DT;

/// Control periods of a forecast: 4 s, the time limit of the policy in an attempt.
const FORECAST_STEPS: usize = (4.0 / CONTROL_DT) as usize;

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
    let ends = forecast(model, tree, observation, &candidates);
    let distance = |end: Option<JointVector>| {
        end.map_or(f64::INFINITY, |end| fingertip_distance(tree, &end, cloud))
    };
    let rated = candidates.into_iter().zip(ends.into_iter().map(distance));
    rated.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(start, _)| start)
}

/// Final configurations (rad) of the policy from start configurations; `None` where it diverges.
fn forecast(
    model: &Model,
    tree: &KinematicTree,
    observation: &Observation,
    starts: &[JointVector],
) -> Vec<Option<JointVector>> {
    let mut states: Vec<Option<JointState>> =
        starts.iter().map(|start| Some(JointState::at_rest(*start))).collect();
    for _ in 0..FORECAST_STEPS {
        let inputs: Vec<_> =
            states.iter().flatten().map(|state| observation.network_input(state)).collect();
        let mut accelerations = model.network.accelerations(&inputs).into_iter();
        for state in &mut states {
            let Some(now) = *state else { continue };
            let next = |qdd| tree.limits.clamp_state(&integrator::step(&now, &qdd, CONTROL_DT));
            *state = accelerations.next().flatten().map(next);
        }
    }
    states.into_iter().map(|state| Some(state?.q)).collect()
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
        let ends = forecast(&model, &tree, &observation, &candidates);
        let distances: Vec<f64> =
            ends.iter().map(|end| fingertip_distance(&tree, &end.unwrap(), &cloud())).collect();
        let best = (0..6).min_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap();
        model.start_candidates = 6;
        assert_eq!(select(&model), Some(candidates[best]), "{distances:?}");
        // The forecast of a start does not depend on the other starts.
        let alone = forecast(&model, &tree, &observation, &candidates[best..=best]);
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
