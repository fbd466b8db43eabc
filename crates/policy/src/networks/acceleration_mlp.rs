//! The baseline: an MLP that predicts joint accelerations directly, without a fabric (paper §III-C).

use crate::networks::NetworkInput;
use crate::networks::fourier::{FourierFeatures, InputBlock, NUM_FEATURES};
use crate::networks::mlp::{Activation, Mlp};
use crate::networks::ngf::SPEED_SCALE;
use crate::weights::{Tensors, WeightsError};
use robot::{DOF, JointLimits, JointVector};

/// Prefix of the layers' tensor names in the weights.
pub const TENSOR_PREFIX: &str = "baseline";

/// Maximum numbers of hidden layers and of units per layer; larger values are rejected as invalid.
const MAX_LAYERS: usize = 16;
const MAX_HIDDEN: usize = 8192;

/// Architecture and input scales of the network.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AccelerationMlpConfig {
    /// Number of units of each hidden layer.
    pub hidden: Vec<usize>,
    /// Fourier features of the inputs; `None` for the raw inputs, as in the paper's baseline.
    pub features: Option<FourierConfig>,
    /// Acceleration (rad/s²) per unit of network output, so that weights of order one suffice.
    pub acceleration_scale: f32,
}

/// Random Fourier features of the inputs.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FourierConfig {
    /// Seed of the frequencies.
    pub seed: u64,
    /// Length scales of q, q̇ and the observation (dimensionless).
    pub scales: [f32; 3],
}

impl AccelerationMlpConfig {
    /// The paper's baseline: hidden layers of 64 and 256 units.
    pub fn paper() -> Self {
        Self { hidden: vec![64, 256], features: None, acceleration_scale: 30.0 }
    }

    /// The Fourier features of the NGF, and about as many weights as its five networks (5.5 million).
    ///
    /// *Beyond the paper: its baseline has 1/200 of the weights of the NGF.*
    pub fn large() -> Self {
        let features = FourierConfig { seed: 2309, scales: [2.0, 3.0, 16.0] };
        Self { hidden: vec![1420; 3], features: Some(features), ..Self::paper() }
    }

    /// Rejects values from which no network can be built; the error names the value.
    pub fn validate(&self) -> Result<(), WeightsError> {
        let reject = |name: &str, value: String| {
            Err(WeightsError::InvalidValue { name: name.to_owned(), value })
        };
        let is_width = |units: &usize| (1..=MAX_HIDDEN).contains(units);
        if !(1..=MAX_LAYERS).contains(&self.hidden.len()) || !self.hidden.iter().all(is_width) {
            return reject("hidden", format!("{:?}", self.hidden));
        }
        let scales = self.features.as_ref().map_or([1.0; 3], |features| features.scales);
        if !scales.iter().all(|scale| scale.is_finite() && *scale > 0.0) {
            return reject("scales", format!("{scales:?}"));
        }
        if !self.acceleration_scale.is_finite() {
            return reject("acceleration_scale", self.acceleration_scale.to_string());
        }
        Ok(())
    }

    /// Widths of the layers, inputs first, for an observation of `observation_dim` values.
    pub fn widths(&self, observation_dim: usize) -> Vec<usize> {
        let inputs = if self.features.is_some() { NUM_FEATURES } else { 2 * DOF + observation_dim };
        [&[inputs], self.hidden.as_slice(), &[DOF]].concat()
    }

    /// The Fourier features, for an observation of `observation_dim` values; `None` for raw inputs.
    pub fn fourier(&self, observation_dim: usize) -> Option<FourierFeatures> {
        let features = self.features.as_ref()?;
        let sizes = [DOF, DOF, observation_dim].into_iter().zip(features.scales);
        let blocks: Vec<InputBlock> =
            sizes.map(|(size, length_scale)| InputBlock { size, length_scale }).collect();
        Some(FourierFeatures::new(&blocks, features.seed))
    }

    /// ReLU, as in the paper; with Fourier features ELU, as in the NGF.
    pub fn activation(&self) -> Activation {
        if self.features.is_some() { Activation::Elu } else { Activation::Relu }
    }
}

/// Network inputs (dimensionless): normalised q, scaled q̇, observation.
pub fn inputs(limits: &JointLimits, input: &NetworkInput) -> Vec<f32> {
    let q = limits.normalize(&input.state.q);
    let qd = input.state.qd / SPEED_SCALE;
    q.iter().chain(qd.iter()).map(|x| *x as f32).chain(input.latent.iter().copied()).collect()
}

/// The network with its weights.
#[derive(Clone, Debug)]
pub struct AccelerationMlp {
    limits: JointLimits,
    fourier: Option<FourierFeatures>,
    mlp: Mlp,
    acceleration_scale: f32,
}

impl AccelerationMlp {
    /// Loads the layers, for an observation of `observation_dim` values.
    pub fn load(
        tensors: &Tensors,
        config: &AccelerationMlpConfig,
        observation_dim: usize,
        limits: &JointLimits,
    ) -> Result<Self, WeightsError> {
        config.validate()?;
        let mlp = Mlp::load(
            tensors,
            TENSOR_PREFIX,
            &config.widths(observation_dim),
            config.activation(),
        )?;
        let fourier = config.fourier(observation_dim);
        Ok(Self {
            limits: limits.clone(),
            fourier,
            mlp,
            acceleration_scale: config.acceleration_scale,
        })
    }

    /// q̈ (rad/s²) for each input of a batch; `None` where it is not finite.
    pub fn accelerations(&self, batch: &[NetworkInput]) -> Vec<Option<JointVector>> {
        let row = |input: &NetworkInput| inputs(&self.limits, input);
        let x: Vec<f32> = batch.iter().flat_map(row).collect();
        let y = match &self.fourier {
            Some(fourier) => self.mlp.apply(&fourier.features(&x)),
            None => self.mlp.apply(&x),
        };
        let acceleration = |y: &[f32]| {
            let qdd = JointVector::from_fn(|i, _| f64::from(self.acceleration_scale * y[i]));
            qdd.iter().all(|x| x.is_finite()).then_some(qdd)
        };
        y.chunks_exact(DOF).map(acceleration).collect()
    }
}
