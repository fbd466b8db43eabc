//! Batched acceleration MLP (the baseline); counterpart of `policy::networks::acceleration_mlp`.

use crate::nn::{Params, mlp};
use anyhow::Result;
use candle_core::{Device, Tensor};
use policy::networks::acceleration_mlp::{AccelerationMlpConfig, TENSOR_PREFIX, inputs};
use policy::networks::fourier::NUM_FREQUENCIES;
use policy::networks::mlp::Activation;
use rand_chacha::ChaCha8Rng;
use robot::{JointLimits, JointState};

/// The baseline's input normalisation and fixed Fourier projection.
pub struct AccelerationMlp {
    limits: JointLimits,
    frequencies: Option<Tensor>,
    layers: usize,
    activation: Activation,
    scale: f64,
}

/// Adds random initial parameters; the last layer is zero, so initial accelerations are zero.
pub fn init(
    params: &mut Params,
    config: &AccelerationMlpConfig,
    observation_dim: usize,
    rng: &mut ChaCha8Rng,
) -> Result<()> {
    params.add_mlp(TENSOR_PREFIX, &config.widths(observation_dim), 0.0, rng)
}

impl AccelerationMlp {
    /// Samples the Fourier frequencies for observations of dimension `observation_dim`.
    pub fn new(
        config: &AccelerationMlpConfig,
        observation_dim: usize,
        limits: &JointLimits,
    ) -> Result<Self> {
        let frequencies = config.fourier(observation_dim).map(|fourier| {
            let shape = (fourier.num_inputs, NUM_FREQUENCIES);
            Tensor::from_vec(fourier.frequencies, shape, &Device::Cpu)
        });
        Ok(Self {
            limits: limits.clone(),
            frequencies: frequencies.transpose()?,
            layers: config.hidden.len() + 1,
            activation: config.activation(),
            scale: f64::from(config.acceleration_scale),
        })
    }

    /// Accelerations (rad/s²), shape (B, DOF), for a batch of states and observations (canonical frame).
    pub fn accelerations(
        &self,
        params: &Params,
        states: &[JointState],
        observations: &[&[f32]],
    ) -> Result<Tensor> {
        let x: Vec<f32> = states
            .iter()
            .zip(observations)
            .flat_map(|(state, observation)| inputs(&self.limits, state, observation))
            .collect();
        let x = Tensor::from_vec(x.clone(), (states.len(), x.len() / states.len()), &Device::Cpu)?;
        let features = match &self.frequencies {
            Some(frequencies) => {
                let phases = x.matmul(frequencies)?;
                Tensor::cat(&[phases.cos()?, phases.sin()?], 1)?
            }
            None => x,
        };
        Ok((mlp(&features, params, TENSOR_PREFIX, self.layers, self.activation)? * self.scale)?)
    }
}
