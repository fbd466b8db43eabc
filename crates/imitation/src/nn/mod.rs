//! The differentiable twins of the networks in `policy`, on tensor batches.
//!
//! The names and shapes of the weights are those that `policy` reads.

pub mod adam;
pub mod autoencoder;
pub mod chamfer;
pub mod head;
pub mod ngf;
pub mod params;

pub use params::Params;

use candle_core::{Result, Tensor};

/// xW + b for a batch, W of shape (inputs, outputs).
pub(crate) fn dense(x: &Tensor, params: &Params, name: &str) -> Result<Tensor> {
    let weight = params.tensor(&format!("{name}.weight"))?;
    x.matmul(weight)?.broadcast_add(params.tensor(&format!("{name}.bias"))?)
}

/// Layers `name.0` to `name.{count - 1}` with ELU between them; the last one is linear.
pub(crate) fn mlp(x: &Tensor, params: &Params, name: &str, count: usize) -> Result<Tensor> {
    let mut h = x.clone();
    for layer in 0..count {
        h = dense(&h, params, &format!("{name}.{layer}"))?;
        if layer + 1 < count {
            h = h.elu(1.0)?;
        }
    }
    Ok(h)
}
