//! Differentiable batched counterparts of the networks in `policy`, with custom candle operations.
//!
//! Weights have the names and shapes that `policy` reads. B is the batch size in all shapes.

pub mod adam;
pub mod networks;
pub mod ops;
pub mod params;

pub use params::Params;

use candle_core::{Result, Tensor};
use ops::linear::LinearAct;
use policy::networks::mlp::Activation;

/// Layer f(xW + b) on a batch, x (B, inputs), W (inputs, outputs).
pub(crate) fn linear(
    x: &Tensor,
    params: &Params,
    name: &str,
    activation: Option<Activation>,
) -> Result<Tensor> {
    let (weight, slot) = params.weight(&format!("{name}.weight"))?;
    x.apply_op3(
        &weight,
        params.tensor(&format!("{name}.bias"))?,
        LinearAct { activation, accumulator: slot },
    )
}

/// Multilayer perceptron of `count` layers `name.0`, `name.1`, ... with `activation` after all but the last
/// one.
pub(crate) fn mlp(
    x: &Tensor,
    params: &Params,
    name: &str,
    count: usize,
    activation: Activation,
) -> Result<Tensor> {
    let mut h = x.clone();
    for layer in 0..count {
        let activation = (layer + 1 < count).then_some(activation);
        h = linear(&h, params, &format!("{name}.{layer}"), activation)?;
    }
    Ok(h)
}
