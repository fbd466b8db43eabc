//! The baseline: one network that says accelerations, without a fabric (paper §III-C).

use crate::fourier::{Block, FEATURES, Fourier};
use crate::mlp::{Activation, Mlp};
use crate::ngf::SPEED_SCALE;
use crate::weights::{Tensors, WeightsError};
use robot::{DOF, JointState, JointVector, Limits};

/// Name of the layers in the weights.
pub const NAME: &str = "baseline";

/// More hidden layers or units are taken for a mistake.
const MOST_LAYERS: usize = 16;
const MOST_HIDDEN: usize = 8192;

/// What decides the network beside its weights.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BaselineConfig {
    /// Units of the hidden layers.
    pub hidden: Vec<usize>,
    /// Fourier features in front of the layers; the paper's baseline has none.
    pub features: Option<Features>,
    /// Accelerations (rad/s²) in units of the network's output: brings them within reach of weights of order one.
    pub acceleration_scale: f32,
}

/// Random Fourier features of the inputs.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Features {
    /// Seed of the frequencies.
    pub seed: u64,
    /// Length scales of q, q̇ and what is told of the object.
    pub scales: [f32; 3],
}

impl BaselineConfig {
    /// The paper's baseline: hidden layers of 64 and 256.
    pub fn paper() -> Self {
        Self { hidden: vec![64, 256], features: None, acceleration_scale: 30.0 }
    }

    /// The features of the NGF, and about as many weights as its five networks (5.5 million).
    ///
    /// *Beyond the paper: its baseline has a 200th of the weights of what it is compared with.*
    pub fn large() -> Self {
        let features = Features { seed: 2309, scales: [2.0, 3.0, 16.0] };
        Self { hidden: vec![1420; 3], features: Some(features), ..Self::paper() }
    }

    /// Refuses what no network can be built from; the message names the value.
    pub fn check(&self) -> Result<(), WeightsError> {
        let refuse =
            |name: &str, value: String| Err(WeightsError::Setting { name: name.to_owned(), value });
        let is_width = |units: &usize| (1..=MOST_HIDDEN).contains(units);
        if !(1..=MOST_LAYERS).contains(&self.hidden.len()) || !self.hidden.iter().all(is_width) {
            return refuse("hidden", format!("{:?}", self.hidden));
        }
        let scales = self.features.as_ref().map_or([1.0; 3], |features| features.scales);
        if !scales.iter().all(|scale| scale.is_finite() && *scale > 0.0) {
            return refuse("scales", format!("{scales:?}"));
        }
        if !self.acceleration_scale.is_finite() {
            return refuse("acceleration_scale", self.acceleration_scale.to_string());
        }
        Ok(())
    }

    /// Widths of the layers, inputs first, if so many numbers tell of the object.
    pub fn widths(&self, object: usize) -> Vec<usize> {
        let inputs = if self.features.is_some() { FEATURES } else { 2 * DOF + object };
        [&[inputs], self.hidden.as_slice(), &[DOF]].concat()
    }

    /// The features' projection, if there is one.
    pub fn fourier(&self, object: usize) -> Option<Fourier> {
        let features = self.features.as_ref()?;
        let sizes = [DOF, DOF, object].into_iter().zip(features.scales);
        let blocks: Vec<Block> =
            sizes.map(|(size, length_scale)| Block { size, length_scale }).collect();
        Some(Fourier::new(&blocks, features.seed))
    }

    /// The rectifier, as in the paper; with features what the NGF has.
    pub fn activation(&self) -> Activation {
        if self.features.is_some() { Activation::Elu } else { Activation::Relu }
    }
}

/// The inputs (dimensionless): normalised q, q̇, what is told of the object.
pub fn inputs(limits: &Limits, state: &JointState, object: &[f32]) -> Vec<f32> {
    let q = limits.normalize(&state.q);
    let qd = state.qd / SPEED_SCALE;
    q.iter().chain(qd.iter()).map(|x| *x as f32).chain(object.iter().copied()).collect()
}

/// The baseline, ready to run.
#[derive(Clone, Debug)]
pub struct Baseline {
    limits: Limits,
    fourier: Option<Fourier>,
    mlp: Mlp,
    scale: f32,
}

impl Baseline {
    /// Reads the layers; `object` numbers tell of the object.
    pub fn load(
        tensors: &Tensors,
        config: &BaselineConfig,
        object: usize,
        limits: &Limits,
    ) -> Result<Self, WeightsError> {
        config.check()?;
        let mlp = Mlp::load(tensors, NAME, &config.widths(object), config.activation())?;
        let fourier = config.fourier(object);
        Ok(Self { limits: limits.clone(), fourier, mlp, scale: config.acceleration_scale })
    }

    /// q̈ (rad/s²) at a state for an object in front; `None` if it is not finite.
    pub fn acceleration(&self, state: &JointState, object: &[f32]) -> Option<JointVector> {
        let x = inputs(&self.limits, state, object);
        let y = match &self.fourier {
            Some(fourier) => self.mlp.apply(&fourier.features(&x)),
            None => self.mlp.apply(&x),
        };
        let qdd = JointVector::from_fn(|i, _| f64::from(self.scale * y[i]));
        qdd.iter().all(|x| x.is_finite()).then_some(qdd)
    }
}
