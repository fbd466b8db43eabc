//! Fingertip errors of a policy in kinematic rollouts, and its damping rate along demonstrations.

use crate::data::demo_group::DemoGroup;
use policy::Network;
use policy::kinematic_rollout::roll_out;
use rayon::prelude::*;
use robot::{JointVector, KinematicTree};

/// Row stride at which the damping rate is evaluated.
const DAMPING_STRIDE: usize = 10;

/// Rollouts of a thread that share the reads of the network's weights.
const ROLLOUT_BATCH: usize = 16;

/// Kinematic rollouts of the policy from up to two neighbour starts per group. Returns the distance (m)
/// between the final fingertips and those of the demonstration, mean over the four tips. Groups without
/// neighbour starts are skipped.
pub fn fingertip_errors(tree: &KinematicTree, policy: &Network, groups: &[&DemoGroup]) -> Vec<f64> {
    let mut starts = Vec::new();
    let mut wanted = Vec::new();
    for group in groups {
        let observation = &group.encodings[group.encodings.len() - 1];
        let grasp = group.demonstrations.state(group.demonstrations.rows() - 1).q;
        for start in group.neighbor_starts.iter().take(2) {
            starts.push((observation, observation.from_canonical(start)));
            wanted.push(grasp);
        }
    }
    let ends =
        starts.par_chunks(ROLLOUT_BATCH).flat_map_iter(|batch| roll_out(policy, tree, batch));
    let ends: Vec<Option<JointVector>> = ends.collect();
    let error = |(end, wanted): (Option<JointVector>, &JointVector)| {
        end.map_or(f64::INFINITY, |end| fingertip_distance(tree, &end, wanted))
    };
    ends.into_iter().zip(&wanted).map(error).collect()
}

/// Distance (m) between the fingertips of two configurations, mean over the four tips.
fn fingertip_distance(tree: &KinematicTree, a: &JointVector, b: &JointVector) -> f64 {
    let (a, b) = (tree.forward_kinematics(a).fingertips(), tree.forward_kinematics(b).fingertips());
    a.iter().zip(&b).map(|(a, b)| (a - b).norm()).sum::<f64>() / 4.0
}

/// Max. damping rate λ_max(B) + β (1/s) of a fabric over the demonstration states; `None` for other networks.
pub fn max_damping_rate(policy: &Network, groups: &[&DemoGroup]) -> Option<f64> {
    let of_group = |group: &&DemoGroup| {
        let (observation, rows) = (&group.encodings[0], group.demonstrations.rows());
        let row = |row| {
            let input = observation.network_input(&group.demonstrations.state(row));
            Some(policy.fabric(input)?.max_damping_rate())
        };
        (0..rows).step_by(DAMPING_STRIDE).filter_map(row).reduce(f64::max)
    };
    groups.par_iter().filter_map(of_group).reduce_with(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::rollout_buffer::fixtures::demo_group;
    use crate::nn::Params;
    use crate::nn::networks;
    use crate::train::expert::DemoTrajectories;
    use policy::PolicyConfig;
    use policy::networks::NetworkConfig;
    use policy::networks::acceleration_mlp::AccelerationMlpConfig;
    use policy::networks::fabric_head::BASE_DAMPING;
    use policy::networks::ngf::NgfConfig;
    use policy::weights::Tensors;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use robot::DOF;

    fn untrained(network: NetworkConfig, tree: &KinematicTree) -> Network {
        let config = PolicyConfig { network, ..PolicyConfig::tiny() };
        let mut params = Params::default();
        networks::init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
        let bytes = params.export(&[]).unwrap();
        Network::load(&Tensors::parse(&bytes).unwrap(), &config, tree).unwrap()
    }

    /// A fabric with only the base potential: it converges to `rest`.
    fn base_potential_only(rest: &JointVector, tree: &KinematicTree) -> Network {
        let config = NgfConfig {
            potential_scale: 0.0,
            potential_center: (*rest).into(),
            ..NgfConfig::tiny()
        };
        untrained(NetworkConfig::Ngf(config), tree)
    }

    #[test]
    fn fingertip_error_is_the_distance_between_policy_goal_and_demonstration() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let center = (tree.limits.lower + tree.limits.upper) * 0.5;
        let policy = base_potential_only(&center, &tree);
        let group_ending_at = |end: JointVector| {
            let row = |q: &JointVector| q.iter().map(|x| *x as f32).chain([0.0; DOF]).collect();
            let mut group = demo_group(0, 0.7);
            let azimuth = group.encodings[1].azimuth;
            let mut end = end;
            end[0] += azimuth;
            let rows: Vec<Vec<f32>> = vec![row(&JointVector::zeros()), row(&end)];
            group.demonstrations = DemoTrajectories::new(rows.concat(), vec![0, 2]);
            group.neighbor_starts = vec![center, center * 0.9, center * 0.8];
            group
        };
        let errors = fingertip_errors(&tree, &policy, &[&group_ending_at(center)]);
        assert!(errors.len() == 2 && errors.iter().all(|error| *error < 1e-4), "{errors:?}");
        let mut shifted = center;
        shifted[3] += 0.2;
        let errors = fingertip_errors(&tree, &policy, &[&group_ending_at(shifted)]);
        let expected = fingertip_distance(&tree, &center, &shifted);
        let is_expected = |error: &f64| (error - expected).abs() < 1e-3;
        assert!(expected > 0.05 && errors.iter().all(is_expected), "{errors:?}");
        let isolated = demo_group(0, 0.7);
        assert!(fingertip_errors(&tree, &policy, &[&isolated]).is_empty(), "no neighbour starts");
    }

    #[test]
    fn max_damping_rate_matches_the_fabric_along_demonstrations() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let found = max_damping_rate(
            &base_potential_only(&JointVector::zeros(), &tree),
            &[&demo_group(0, 0.0)],
        );
        // β_f = 51 + 1e-3, M = 2 (1 + 1e-3)² I + 0.02 I.
        let expected = 51.001 / (2.0 * 1.001 * 1.001 + 0.02) + BASE_DAMPING;
        assert!((found.unwrap() - expected).abs() < 1e-3 * expected, "{found:?}");
        let baseline = untrained(NetworkConfig::Mlp(AccelerationMlpConfig::paper()), &tree);
        assert_eq!(max_damping_rate(&baseline, &[&demo_group(0, 0.0)]), None);
    }
}
