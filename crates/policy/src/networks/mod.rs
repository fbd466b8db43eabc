//! The policies of the comparison: their observation of the object, and their network (paper §IV).
//!
//! [`ngf`] is the paper's policy, [`acceleration_mlp`] its baseline. [`fabric_head`] turns the outputs of the NGF into
//! q̈; [`fourier`] and [`mlp`] are building blocks.

pub mod acceleration_mlp;
pub mod fabric_head;
pub mod fourier;
pub mod mlp;
pub mod ngf;
pub mod surface_vectors;

use crate::LATENT_DIM;
use crate::encoder;
use crate::networks::acceleration_mlp::{AccelerationMlp, AccelerationMlpConfig};
use crate::networks::fabric_head::NeuralFabric;
use crate::networks::ngf::{Ngf, NgfConfig};
use crate::observation::{self, BOX_DIM, Observation};
use crate::weights::{Tensors, WeightsError};
use geometry::Vec3;
use robot::{JointState, JointVector, KinematicTree};

/// The policy's observation of the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObservationKind {
    /// z of the point cloud (the paper's -PCD).
    Cloud,
    /// Centroid of the point cloud in the canonical frame, in workspace units (the paper's -POS).
    Position,
    /// z of the point cloud, then the box around it ([`observation::cloud_box`]). z alone carries no size or
    /// height beyond those that the encoder was trained on.
    CloudAndBox,
    /// As `CloudAndBox`, then [`NUM_SURFACE_POINTS`] points of the cloud (m, canonical frame), from which a network
    /// computes [`surface_vectors`].
    CloudAndSurface,
}

/// Number of cloud points in [`ObservationKind::CloudAndSurface`], the first ones in farthest-point order.
pub const NUM_SURFACE_POINTS: usize = 256;

impl ObservationKind {
    /// Number of values of the observation.
    pub fn dim(self) -> usize {
        match self {
            Self::Cloud => LATENT_DIM,
            Self::Position => 3,
            Self::CloudAndBox => LATENT_DIM + BOX_DIM,
            Self::CloudAndSurface => LATENT_DIM + BOX_DIM + 3 * NUM_SURFACE_POINTS,
        }
    }

    /// Number of values that are features of the object, without surface points.
    pub fn num_features(self) -> usize {
        self.dim().min(LATENT_DIM + BOX_DIM)
    }

    /// Whether the first [`LATENT_DIM`] values are z.
    pub fn has_latent(self) -> bool {
        self != Self::Position
    }

    /// The observation of a cloud (m) in the canonical frame; `latent` is its z, if the kind has one.
    pub fn values(self, latent: Vec<f32>, canonical: &[Vec3]) -> Vec<f32> {
        match self {
            Self::Cloud => latent,
            Self::Position => normalized_centroid(canonical),
            Self::CloudAndBox => [latent.as_slice(), &observation::cloud_box(canonical)].concat(),
            Self::CloudAndSurface => {
                let surface = (0..NUM_SURFACE_POINTS)
                    .flat_map(|i| canonical.get(i % canonical.len().max(1)).copied())
                    .flat_map(|point| point.to_array());
                let mut values = Self::CloudAndBox.values(latent, canonical);
                values.extend(surface);
                values.resize(self.dim(), 0.0);
                values
            }
        }
    }
}

/// Centroid of a cloud (m) in the canonical frame, in workspace units ([`encoder::normalized_position`]).
pub fn normalized_centroid(canonical: &[Vec3]) -> Vec<f32> {
    let sum = canonical.iter().fold(Vec3::ZERO, |sum, point| sum + *point);
    encoder::normalized_position(sum / canonical.len().max(1) as f32).to_vec()
}

/// Observation and network of a policy.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyConfig {
    /// Observation of the object.
    pub observation: ObservationKind,
    /// Architecture and scales of the network.
    pub network: NetworkConfig,
}

/// Architecture and scales of a network.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NetworkConfig {
    /// A Neural Geometric Fabric.
    Ngf(NgfConfig),
    /// The baseline: a multilayer perceptron.
    Mlp(AccelerationMlpConfig),
}

/// Names of the policies of the paper's §IV, and of one beyond the paper.
pub const POLICY_NAMES: [&str; 5] = ["ngf-pcd", "ngf-pos", "mlp-pcd", "mlp-pos", "mlp-large-pcd"];

impl PolicyConfig {
    /// The policy of a name in [`POLICY_NAMES`]; `None` for other names.
    ///
    /// ```rust
    /// use policy::{LATENT_DIM, ObservationKind, PolicyConfig};
    /// // `-pcd` observes the encoded point cloud, `-pos` its centroid.
    /// let config = PolicyConfig::by_name("ngf-pcd").expect("a policy of the paper");
    /// assert_eq!(config.observation, ObservationKind::Cloud);
    /// assert_eq!(config.observation.dim(), LATENT_DIM);
    /// assert!(PolicyConfig::by_name("ngf").is_none());
    /// ```
    pub fn by_name(name: &str) -> Option<Self> {
        let (network, suffix) = name.rsplit_once('-')?;
        let observation = match suffix {
            "pcd" => ObservationKind::Cloud,
            "pos" => ObservationKind::Position,
            _ => return None,
        };
        let network = match network {
            "ngf" => NetworkConfig::Ngf(NgfConfig {
                // A position has three values of order one, z has 32.
                latent_scale: if observation == ObservationKind::Position { 2.0 } else { 16.0 },
                ..NgfConfig::paper()
            }),
            "mlp" => NetworkConfig::Mlp(AccelerationMlpConfig::paper()),
            "mlp-large" => NetworkConfig::Mlp(AccelerationMlpConfig::large()),
            _ => return None,
        };
        Some(Self { observation, network })
    }

    /// A small NGF for tests.
    pub fn tiny() -> Self {
        let network = NetworkConfig::Ngf(NgfConfig::tiny());
        Self { observation: ObservationKind::Cloud, network }
    }
}

/// Input of a network.
#[derive(Clone, Copy, Debug)]
pub struct NetworkInput<'a> {
    /// Joint state in the canonical frame.
    pub state: JointState,
    /// z of the point cloud, or its centroid, or z and its box ([`ObservationKind`]).
    pub latent: &'a [f32],
    /// Points of the surface (m, canonical frame; x, y, z in turn), empty for most observations.
    pub surface: &'a [f32],
}

impl<'a> NetworkInput<'a> {
    /// Input at a state (canonical frame), for the values of an observation.
    pub fn new(state: JointState, observation: &'a [f32]) -> Self {
        let num_features = ObservationKind::CloudAndSurface.num_features();
        let (latent, surface) = observation.split_at(observation.len().min(num_features));
        Self { state, latent, surface }
    }
}

/// The network of a policy, with its weights.
#[derive(Clone, Debug)]
pub enum Network {
    /// A Neural Geometric Fabric.
    Ngf(Box<Ngf>),
    /// The baseline: a multilayer perceptron.
    Mlp(Box<AccelerationMlp>),
}

impl Network {
    /// Loads the weights.
    pub fn load(
        tensors: &Tensors,
        config: &PolicyConfig,
        tree: &KinematicTree,
    ) -> Result<Self, WeightsError> {
        let observation_dim = config.observation.num_features();
        Ok(match &config.network {
            NetworkConfig::Ngf(ngf) => {
                Self::Ngf(Box::new(Ngf::load(tensors, ngf, observation_dim, tree)?))
            }
            NetworkConfig::Mlp(mlp) => {
                let mlp = AccelerationMlp::load(tensors, mlp, observation_dim, &tree.limits)?;
                Self::Mlp(Box::new(mlp))
            }
        })
    }

    /// q̈ (rad/s²) at a state in the base frame, for an observed object; `None` if it is not finite.
    pub fn acceleration(
        &self,
        state: &JointState,
        observation: &Observation,
    ) -> Option<JointVector> {
        self.accelerations(&[observation.network_input(state)]).pop().flatten()
    }

    /// q̈ (rad/s²) for each input of a batch; `None` where it is not finite. The bits do not depend on the
    /// batch. A batch takes less time than its inputs in turn, because each weight is read once.
    pub fn accelerations(&self, batch: &[NetworkInput]) -> Vec<Option<JointVector>> {
        match self {
            Self::Ngf(ngf) => ngf.accelerations(batch),
            Self::Mlp(mlp) => mlp.accelerations(batch),
        }
    }

    /// The neural fabric at a state in the canonical frame; `None` for the baseline.
    pub fn fabric(&self, input: NetworkInput) -> Option<NeuralFabric> {
        match self {
            Self::Ngf(ngf) => Some(ngf.outputs(&[input]).pop()?.fabric(&input.state.qd)),
            Self::Mlp(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::networks::fourier::NUM_FEATURES;
    use crate::networks::ngf::SUBNETWORKS;

    #[test]
    fn every_policy_configuration_round_trips_through_json() {
        for name in POLICY_NAMES {
            let config = PolicyConfig::by_name(name).expect(name);
            let text = serde_json::to_string(&config).unwrap();
            assert_eq!(serde_json::from_str::<PolicyConfig>(&text).unwrap(), config);
        }
        assert!(
            PolicyConfig::by_name("ngf").is_none() && PolicyConfig::by_name("rnn-pcd").is_none()
        );
    }

    #[test]
    fn values_of_an_observation_have_its_dimension() {
        let cloud = [Vec3::new(0.5, 0.0, -0.2), Vec3::new(0.9, 0.0, 0.0)];
        let kinds = [
            ObservationKind::Cloud,
            ObservationKind::Position,
            ObservationKind::CloudAndBox,
            ObservationKind::CloudAndSurface,
        ];
        for kind in kinds {
            let z = if kind.has_latent() { vec![0.5; LATENT_DIM] } else { Vec::new() };
            let values = kind.values(z, &cloud);
            assert_eq!(values.len(), kind.dim());
            assert_eq!(values[0] == 0.5 && values[1] == 0.5, kind.has_latent());
        }
    }

    #[test]
    fn large_baseline_has_as_many_weights_as_the_ngf() {
        let weights = |widths: &[usize]| -> usize {
            widths.windows(2).map(|pair| (pair[0] + 1) * pair[1]).sum()
        };
        let ngf: usize = SUBNETWORKS
            .iter()
            .map(|subnetwork| weights(&subnetwork.widths(&NgfConfig::paper())))
            .sum();
        let large = weights(&AccelerationMlpConfig::large().widths(LATENT_DIM));
        assert!(large.abs_diff(ngf) < ngf / 100, "{large} against {ngf}");
        let paper = AccelerationMlpConfig::paper().widths(LATENT_DIM);
        assert_eq!(paper, [78, 64, 256, 23]);
        assert_eq!(AccelerationMlpConfig::large().widths(3)[0], NUM_FEATURES);
    }

    #[test]
    fn position_is_centroid_of_cloud_in_workspace_units() {
        let cloud = [Vec3::new(0.5, 0.0, -0.2), Vec3::new(0.9, 0.0, 0.0)];
        let wanted = [0.5, 0.0, 0.25];
        for (got, wanted) in normalized_centroid(&cloud).iter().zip(wanted) {
            assert!((got - wanted).abs() < 1e-6, "{got} against {wanted}");
        }
    }
}
