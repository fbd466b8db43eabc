//! Batched networks that output q̈ directly: an MLP on the normalised inputs or on their Fourier features.
//! Counterparts of `policy::networks::acceleration_mlp`.

use crate::nn::{Params, mlp};
use anyhow::{Result, bail};
use candle_core::{Device, Tensor};
use policy::networks::NetworkConfig;
use policy::networks::acceleration_mlp::{TENSOR_PREFIX, inputs};
use policy::networks::fourier::{FourierFeatures, NUM_FREQUENCIES};
use policy::networks::mlp::Activation;
use policy::{NetworkInput, PolicyConfig};
use rand_chacha::ChaCha8Rng;
use robot::{JointLimits, JointState};

/// Layers of a network and their input and output.
struct Architecture {
    /// Prefix of the layers' names in the weights.
    prefix: &'static str,
    /// Number of inputs, hidden units and outputs.
    widths: Vec<usize>,
    /// Features of the inputs; `None` if the first layer takes the inputs themselves.
    features: Option<FourierFeatures>,
    /// Activation of the hidden layers.
    activation: Activation,
    /// Acceleration (rad/s²) per unit of output.
    scale: f32,
}

/// Architecture of a configuration; an error for a fabric.
fn architecture(config: &PolicyConfig) -> Result<Architecture> {
    let observation_dim = config.observation.num_features();
    Ok(match &config.network {
        NetworkConfig::Mlp(mlp) => Architecture {
            prefix: TENSOR_PREFIX,
            widths: mlp.widths(observation_dim),
            features: mlp.fourier(observation_dim),
            activation: mlp.activation(),
            scale: mlp.acceleration_scale,
        },
        NetworkConfig::Ngf(_) => bail!("a fabric does not output accelerations directly"),
    })
}

/// Adds random initial parameters; the last layer is zero, so initial accelerations are zero.
pub fn init(params: &mut Params, config: &PolicyConfig, rng: &mut ChaCha8Rng) -> Result<()> {
    let Architecture { prefix, widths, .. } = architecture(config)?;
    params.add_mlp(prefix, &widths, 0.0, rng)
}

/// Input normalisation, fixed Fourier projection and layers of a network.
pub struct DirectNetwork {
    limits: JointLimits,
    frequencies: Option<Tensor>,
    prefix: &'static str,
    layers: usize,
    activation: Activation,
    scale: f64,
}

impl DirectNetwork {
    /// Samples the Fourier frequencies, if any.
    pub fn new(config: &PolicyConfig, limits: &JointLimits) -> Result<Self> {
        let Architecture { prefix, widths, features, activation, scale } = architecture(config)?;
        let frequencies = features.map(|fourier| {
            let shape = (fourier.num_inputs, NUM_FREQUENCIES);
            Tensor::from_vec(fourier.frequencies, shape, &Device::Cpu)
        });
        Ok(Self {
            limits: limits.clone(),
            frequencies: frequencies.transpose()?,
            prefix,
            layers: widths.len() - 1,
            activation,
            scale: f64::from(scale),
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
            .flat_map(|(state, latent)| inputs(&self.limits, &NetworkInput::new(*state, latent)))
            .collect();
        let x = Tensor::from_vec(x.clone(), (states.len(), x.len() / states.len()), &Device::Cpu)?;
        let features = match &self.frequencies {
            Some(frequencies) => {
                let phases = x.matmul(frequencies)?;
                Tensor::cat(&[phases.cos()?, phases.sin()?], 1)?
            }
            None => x,
        };
        Ok((mlp(&features, params, self.prefix, self.layers, self.activation)? * self.scale)?)
    }
}
