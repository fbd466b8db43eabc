//! How far a policy is from a gradient field: the antisymmetric share of ∂q̈/∂q.
//!
//! q̈ of a conservative field with a constant isotropic metric is -∇ψ times a constant, so its Jacobian is
//! symmetric. F_ψ alone can represent only such fields.

use crate::data::demo_group::DemoGroup;
use nalgebra::SMatrix;
use policy::{Network, NetworkInput};
use rayon::prelude::*;
use robot::{DOF, JointState, JointVector};

/// Shift (rad) of the central differences.
const SHIFT: f64 = 0.02;

/// Row stride at which the Jacobian is evaluated.
const ROW_STRIDE: usize = 10;

/// |A|² / |J|² at each state of the first demonstration of each group, every tenth row, at rest. A is the
/// antisymmetric part of J = ∂q̈/∂q. 0 for a symmetric J, 1 for an antisymmetric one, 1/2 for random entries.
pub fn antisymmetric_shares(policy: &Network, groups: &[&DemoGroup]) -> Vec<f64> {
    let of_group = |group: &&DemoGroup| -> Vec<f64> {
        let observation = &group.encodings[group.encodings.len() - 1];
        let rows = group.demonstrations.row_range(0);
        let of_row = |row| {
            let q = observation.to_canonical(&group.demonstrations.state(row).q);
            antisymmetric_share(policy, &q, &observation.latent)
        };
        (rows.0..rows.1).step_by(ROW_STRIDE).filter_map(of_row).collect()
    };
    groups.par_iter().flat_map_iter(of_group).collect()
}

/// |A|² / |J|² at a configuration in the canonical frame; `None` where q̈ or the ratio is not finite.
fn antisymmetric_share(policy: &Network, q: &JointVector, latent: &[f32]) -> Option<f64> {
    let shifted = |joint: usize, shift: f64| {
        let mut q = *q;
        q[joint] += shift;
        NetworkInput::new(JointState::at_rest(q), latent)
    };
    let inputs: Vec<NetworkInput> =
        (0..DOF).flat_map(|joint| [shifted(joint, SHIFT), shifted(joint, -SHIFT)]).collect();
    let accelerations: Vec<JointVector> =
        policy.accelerations(&inputs).into_iter().collect::<Option<_>>()?;
    let columns: Vec<JointVector> =
        accelerations.chunks_exact(2).map(|pair| (pair[0] - pair[1]) / (2.0 * SHIFT)).collect();
    let jacobian = SMatrix::<f64, DOF, DOF>::from_columns(&columns);
    let antisymmetric = (jacobian - jacobian.transpose()) * 0.5;
    let share = antisymmetric.norm_squared() / jacobian.norm_squared();
    share.is_finite().then_some(share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::rollout_buffer::fixtures::demo_group;
    use crate::nn::Params;
    use crate::nn::networks;
    use policy::PolicyConfig;
    use policy::networks::NetworkConfig;
    use policy::networks::acceleration_mlp::AccelerationMlpConfig;
    use policy::networks::ngf::SUBNETWORKS;
    use policy::weights::Tensors;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use robot::KinematicTree;

    /// A network with the initial values, plus waves in the parameters whose names start with `prefix`.
    fn perturbed(network: NetworkConfig, prefix: &str) -> Network {
        let config = PolicyConfig { network, ..PolicyConfig::tiny() };
        let mut params = Params::default();
        networks::init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
        let is_perturbed: Vec<bool> = params
            .names()
            .flat_map(|name| {
                let count = params.tensor(name).unwrap().elem_count();
                vec![name.starts_with(prefix); count]
            })
            .collect();
        let values: Vec<f32> = params
            .values()
            .unwrap()
            .into_iter()
            .zip(is_perturbed)
            .enumerate()
            .map(|(k, (value, is_perturbed))| {
                let wave = 0.1 * libm::sinf((k * k % 9973) as f32);
                if is_perturbed { value + wave } else { value }
            })
            .collect();
        params.set_values(&values).unwrap();
        let bytes = params.export(&[]).unwrap();
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        Network::load(&Tensors::parse(&bytes).unwrap(), &config, &tree).unwrap()
    }

    #[test]
    fn only_gradient_fields_have_a_symmetric_jacobian() {
        let group = demo_group(0, 0.7);
        let tiny = PolicyConfig::tiny().network;
        let potential = perturbed(tiny.clone(), "potential");
        let shares = antisymmetric_shares(&potential, &[&group]);
        assert!(!shares.is_empty() && shares.iter().all(|share| *share < 1e-3), "{shares:?}");
        let with_geometry = perturbed(tiny, SUBNETWORKS[0].name);
        assert_eq!(antisymmetric_shares(&with_geometry, &[&group]).len(), shares.len());
        let baseline = perturbed(NetworkConfig::Mlp(AccelerationMlpConfig::paper()), "");
        let shares = antisymmetric_shares(&baseline, &[&group]);
        assert!(shares.iter().all(|share| (0.3..0.7).contains(share)), "{shares:?}");
    }
}
