//! The policies that are compared: what they are told of the object, and which network acts on it (paper §IV).

use crate::baseline::{Baseline, BaselineConfig};
use crate::encoder::{self, LATENT};
use crate::head::Fabric;
use crate::ngf::{Ngf, NgfConfig};
use crate::weights::{Tensors, WeightsError};
use geometry::Vec3;
use robot::{JointState, JointVector, Limits};

/// What a policy is told of the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Observation {
    /// z of its cloud (the paper's -PCD).
    Cloud,
    /// Where the middle of its cloud is (-POS).
    Position,
}

impl Observation {
    /// How many numbers that is.
    pub fn size(self) -> usize {
        match self {
            Self::Cloud => LATENT,
            Self::Position => 3,
        }
    }
}

/// The middle of a cloud that has been turned to the front, in units of the workspace.
pub fn position(front: &[Vec3]) -> Vec<f32> {
    let sum = front.iter().fold(Vec3::ZERO, |sum, point| sum + *point);
    encoder::global_position(sum / front.len().max(1) as f32).to_vec()
}

/// What decides a policy beside its weights.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PolicyConfig {
    /// What it is told.
    pub observation: Observation,
    /// What acts.
    pub network: NetworkConfig,
}

/// Sizes and scales of a network.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NetworkConfig {
    /// A Neural Geometric Fabric.
    Ngf(NgfConfig),
    /// The baseline.
    Mlp(BaselineConfig),
}

/// Names of the policies of the paper's §IV, and of one beyond it.
pub const POLICIES: [&str; 5] = ["ngf-pcd", "ngf-pos", "mlp-pcd", "mlp-pos", "mlp-large-pcd"];

impl PolicyConfig {
    /// A policy by its name in [`POLICIES`].
    pub fn named(name: &str) -> Option<Self> {
        let (network, told) = name.rsplit_once('-')?;
        let observation = match told {
            "pcd" => Observation::Cloud,
            "pos" => Observation::Position,
            _ => return None,
        };
        let network = match network {
            "ngf" => NetworkConfig::Ngf(NgfConfig {
                // A position is three numbers of order one, not 32.
                latent_scale: if observation == Observation::Position { 2.0 } else { 16.0 },
                ..NgfConfig::paper()
            }),
            "mlp" => NetworkConfig::Mlp(BaselineConfig::paper()),
            "mlp-large" => NetworkConfig::Mlp(BaselineConfig::large()),
            _ => return None,
        };
        Some(Self { observation, network })
    }

    /// A small NGF for tests.
    pub fn tiny() -> Self {
        let network = NetworkConfig::Ngf(NgfConfig::tiny());
        Self { observation: Observation::Cloud, network }
    }
}

/// A policy, ready to run.
#[derive(Clone, Debug)]
pub enum Network {
    /// A Neural Geometric Fabric.
    Ngf(Ngf),
    /// The baseline.
    Mlp(Baseline),
}

impl Network {
    /// Reads the weights.
    pub fn load(
        tensors: &Tensors,
        config: &PolicyConfig,
        limits: &Limits,
    ) -> Result<Self, WeightsError> {
        let object = config.observation.size();
        Ok(match &config.network {
            NetworkConfig::Ngf(ngf) => Self::Ngf(Ngf::load(tensors, ngf, object, limits)?),
            NetworkConfig::Mlp(mlp) => Self::Mlp(Baseline::load(tensors, mlp, object, limits)?),
        })
    }

    /// q̈ (rad/s²) at a state, for what is told of an object in front; `None` if it is not finite.
    pub fn acceleration(&self, state: &JointState, object: &[f32]) -> Option<JointVector> {
        match self {
            Self::Ngf(ngf) => ngf.acceleration(state, object),
            Self::Mlp(mlp) => mlp.acceleration(state, object),
        }
    }

    /// The fabric that acts at a state; `None` of another policy.
    pub fn fabric(&self, state: &JointState, object: &[f32]) -> Option<Fabric> {
        match self {
            Self::Ngf(ngf) => Some(ngf.outputs(state, object).fabric(&state.qd)),
            Self::Mlp(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fourier::FEATURES;
    use crate::ngf::PARTS;

    #[test]
    fn every_policy_has_a_configuration_that_is_read_back() {
        for name in POLICIES {
            let config = PolicyConfig::named(name).expect(name);
            let text = serde_json::to_string(&config).unwrap();
            assert_eq!(serde_json::from_str::<PolicyConfig>(&text).unwrap(), config);
        }
        assert!(PolicyConfig::named("ngf").is_none() && PolicyConfig::named("rnn-pcd").is_none());
    }

    #[test]
    fn the_large_baseline_has_as_many_weights_as_the_ngf() {
        let weights = |widths: &[usize]| -> usize {
            widths.windows(2).map(|pair| (pair[0] + 1) * pair[1]).sum()
        };
        let ngf: usize = PARTS.iter().map(|part| weights(&part.widths(&NgfConfig::paper()))).sum();
        let large = weights(&BaselineConfig::large().widths(LATENT));
        assert!(large.abs_diff(ngf) < ngf / 100, "{large} against {ngf}");
        let paper = BaselineConfig::paper().widths(LATENT);
        assert_eq!(paper, [78, 64, 256, 23]);
        assert_eq!(BaselineConfig::large().widths(3)[0], FEATURES);
    }

    #[test]
    fn the_position_is_the_middle_of_the_cloud_in_units_of_the_workspace() {
        let cloud = [Vec3::new(0.5, 0.0, -0.2), Vec3::new(0.9, 0.0, 0.0)];
        let wanted = [0.5, 0.0, 0.25];
        for (got, wanted) in position(&cloud).iter().zip(wanted) {
            assert!((got - wanted).abs() < 1e-6, "{got} against {wanted}");
        }
    }
}
