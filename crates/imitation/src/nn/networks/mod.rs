//! Batched policy networks; counterparts of `policy::networks`, and the autoencoder.

pub mod autoencoder;
pub mod direct;
pub mod ngf;

use crate::nn::Params;
use crate::nn::networks::direct::DirectNetwork;
use crate::nn::networks::ngf::{Ngf, SubnetOutput, TrainableSet};
use anyhow::Result;
use candle_core::Tensor;
use policy::PolicyConfig;
use policy::networks::NetworkConfig;
use policy::networks::fabric_head::TRIANGLE_ENTRIES;
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState, KinematicTree};

/// A trainable policy network.
pub enum Network {
    /// A Neural Geometric Fabric.
    Ngf(Box<Ngf>),
    /// A network without a fabric, such as the baseline.
    Direct(Box<DirectNetwork>),
}

/// Output of a network for a batch.
pub struct NetworkOutput {
    /// Accelerations (rad/s²), shape (B, DOF).
    pub accelerations: Tensor,
    /// Mean square of the entries of the metric factors U; `None` for networks other than a fabric.
    pub metric_penalty: Option<Tensor>,
}

/// Adds random initial parameters of the configured network.
pub fn init(params: &mut Params, config: &PolicyConfig, rng: &mut ChaCha8Rng) -> Result<()> {
    match &config.network {
        NetworkConfig::Ngf(ngf) => ngf::init(params, ngf, rng),
        _ => direct::init(params, config, rng),
    }
}

impl Network {
    /// Samples the fixed Fourier frequencies.
    pub fn new(config: &PolicyConfig, tree: &KinematicTree) -> Result<Self> {
        Ok(match &config.network {
            NetworkConfig::Ngf(ngf) => {
                Self::Ngf(Box::new(Ngf::new(ngf, config.observation.num_features(), tree)?))
            }
            _ => Self::Direct(Box::new(DirectNetwork::new(config, &tree.limits)?)),
        })
    }

    /// The trainable subnetworks in the set `active`; a direct network is a single one.
    pub fn subnets(&self, active: TrainableSet) -> Vec<SubnetOutput> {
        match self {
            Self::Ngf(ngf) => ngf.subnets(active),
            Self::Direct(_) => vec![SubnetOutput { subnetwork: 0, columns: 0..DOF, passes: 3 }],
        }
    }

    /// Output of one subnetwork for a batch of states and observations, shape (B, number of its columns).
    pub fn output(
        &self,
        params: &Params,
        subnet: &SubnetOutput,
        states: &[JointState],
        observations: &[&[f32]],
    ) -> Result<Tensor> {
        match self {
            Self::Ngf(ngf) => ngf.output(params, subnet, states, observations),
            Self::Direct(network) => network.accelerations(params, states, observations),
        }
    }

    /// Output row of the initial, untrained network; inactive subnetworks use their columns of it.
    pub fn inactive_output(&self) -> Vec<f32> {
        match self {
            Self::Ngf(_) => Ngf::inactive_output(),
            Self::Direct(_) => vec![0.0; DOF],
        }
    }

    /// Network output from the packed outputs of all subnetworks, shape (B, row length).
    pub fn head(&self, outputs: &Tensor, states: &[JointState]) -> Result<NetworkOutput> {
        Ok(match self {
            Self::Ngf(_) => NetworkOutput {
                accelerations: Ngf::resolve(outputs, states)?,
                metric_penalty: Some(
                    outputs.narrow(1, 0, 2 * TRIANGLE_ENTRIES)?.sqr()?.mean_all()?,
                ),
            },
            Self::Direct(_) => {
                NetworkOutput { accelerations: outputs.clone(), metric_penalty: None }
            }
        })
    }

    /// Network output for a batch of states and observations, as one differentiable graph.
    pub fn forward(
        &self,
        params: &Params,
        states: &[JointState],
        observations: &[&[f32]],
    ) -> Result<NetworkOutput> {
        let output = |subnet| self.output(params, subnet, states, observations);
        let outputs: Vec<Tensor> =
            self.subnets(TrainableSet::All).iter().map(output).collect::<Result<_>>()?;
        self.head(&Tensor::cat(&outputs, 1)?.contiguous()?, states)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::networks::POLICY_NAMES;
    use policy::networks::ngf::NgfConfig;
    use policy::weights::Tensors;
    use policy::{NetworkInput, ObservationKind};
    use rand::SeedableRng;
    use robot::JointVector;

    #[test]
    fn batched_networks_match_the_inference_networks() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let named = POLICY_NAMES.map(|name| (name, PolicyConfig::by_name(name).unwrap()));
        let with_vectors = PolicyConfig {
            observation: ObservationKind::CloudAndSurface,
            network: NetworkConfig::Ngf(NgfConfig { surface_vectors: true, ..NgfConfig::paper() }),
        };
        for (name, config) in named.into_iter().chain([("surface vectors", with_vectors)]) {
            let mut params = Params::default();
            init(&mut params, &config, &mut ChaCha8Rng::seed_from_u64(4)).unwrap();
            // Initial last layers are zero. Nonzero weights, rounded to half precision, make the comparison
            // meaningful.
            let wave = |k: usize| half::f16::from_f32(0.1 * libm::sinf((k * k % 997) as f32));
            let values: Vec<f32> = (0..params.count()).map(|k| wave(k).to_f32()).collect();
            params.set_values(&values).unwrap();
            let bytes = params.export(&[]).unwrap();
            let inference = policy::Network::load(&Tensors::parse(&bytes).unwrap(), &config, &tree);
            let inference = inference.unwrap();
            let network = Network::new(&config, &tree).unwrap();

            let state = |k: usize| JointState {
                q: JointVector::from_fn(|i, _| libm::sin((k * 5 + i) as f64) * 0.8),
                qd: JointVector::from_fn(|i, _| libm::cos((k * 3 + i) as f64)),
            };
            let states: Vec<JointState> = (0..8).map(state).collect();
            let observation: Vec<f32> =
                (0..config.observation.dim()).map(|i| libm::sinf(i as f32)).collect();
            let observations = vec![observation.as_slice(); 8];
            let got = network.forward(&params, &states, &observations).unwrap();
            for (state, got) in states.iter().zip(got.accelerations.to_vec2::<f32>().unwrap()) {
                let input = NetworkInput::new(*state, &observation);
                let expected = inference.accelerations(&[input])[0].unwrap();
                let error_of = |i: usize| (f64::from(got[i]) - expected[i]).abs();
                let error = (0..DOF).map(error_of).fold(0.0, f64::max);
                assert!(
                    expected.norm() > 0.1 && error < 1e-4 * expected.norm(),
                    "{name}: {error} of {}",
                    expected.norm()
                );
            }
        }
    }
}
