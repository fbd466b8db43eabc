//! The differentiable twins of the networks in `policy`, on tensor batches.
//!
//! The names and shapes of the weights are those that `policy` reads.

pub mod adam;
pub mod autoencoder;
pub mod baseline;
pub mod chamfer;
pub mod dense;
#[cfg(test)]
mod differences;
pub mod features;
pub mod gate;
pub mod head;
mod memory;
pub mod network;
pub mod ngf;
pub mod params;
pub mod pool;
pub mod slot;
pub mod transposed;

pub use params::Params;

use candle_core::{Result, Tensor};
use dense::Dense;
use policy::mlp::Activation;

/// f(xW + b) for a batch, W of shape (inputs, outputs).
pub(crate) fn dense(
    x: &Tensor,
    params: &Params,
    name: &str,
    activation: Option<Activation>,
) -> Result<Tensor> {
    let (weight, slot) = params.weight(&format!("{name}.weight"))?;
    x.apply_op3(&weight, params.tensor(&format!("{name}.bias"))?, Dense { activation, slot })
}

/// Layers `name.0` to `name.{count - 1}` with `activation` between them; the last one is linear.
pub(crate) fn mlp(
    x: &Tensor,
    params: &Params,
    name: &str,
    count: usize,
    activation: Activation,
) -> Result<Tensor> {
    let mut h = x.clone();
    for layer in 0..count {
        let after = (layer + 1 < count).then_some(activation);
        h = dense(&h, params, &format!("{name}.{layer}"), after)?;
    }
    Ok(h)
}
