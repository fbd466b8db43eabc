//! The baseline on a batch; the twin of `policy::baseline`.

use super::{Params, mlp};
use anyhow::Result;
use candle_core::{Device, Tensor};
use policy::baseline::{BaselineConfig, NAME, inputs};
use policy::fourier::FREQUENCIES;
use policy::mlp::Activation;
use rand_chacha::ChaCha8Rng;
use robot::{JointState, Limits};

/// The baseline's fixed projection, if it has one.
pub struct Baseline {
    limits: Limits,
    frequencies: Option<Tensor>,
    layers: usize,
    activation: Activation,
    scale: f64,
}

/// Adds fresh parameters; accelerations begin at zero.
pub fn init(
    params: &mut Params,
    config: &BaselineConfig,
    object: usize,
    rng: &mut ChaCha8Rng,
) -> Result<()> {
    params.add_mlp(NAME, &config.widths(object), 0.0, rng)
}

impl Baseline {
    /// Draws the frequencies; `object` numbers tell of the object.
    pub fn new(config: &BaselineConfig, object: usize, limits: &Limits) -> Result<Self> {
        let frequencies = config.fourier(object).map(|fourier| {
            let shape = (fourier.inputs, FREQUENCIES);
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

    /// Accelerations, shape (B, DOF), for the states of a batch and what is told of their objects.
    pub fn accelerations(
        &self,
        params: &Params,
        states: &[JointState],
        objects: &[&[f32]],
    ) -> Result<Tensor> {
        let x: Vec<f32> = states
            .iter()
            .zip(objects)
            .flat_map(|(state, object)| inputs(&self.limits, state, object))
            .collect();
        let x = Tensor::from_vec(x.clone(), (states.len(), x.len() / states.len()), &Device::Cpu)?;
        let features = match &self.frequencies {
            Some(frequencies) => {
                let phases = x.matmul(frequencies)?;
                Tensor::cat(&[phases.cos()?, phases.sin()?], 1)?
            }
            None => x,
        };
        Ok((mlp(&features, params, NAME, self.layers, self.activation)? * self.scale)?)
    }
}
