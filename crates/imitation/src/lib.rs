//! Imitation learning: surrogate expert, differentiable networks, DAgger.
//!
//! Runs offline. The networks are trained with candle; parity tests compare them with the inference code in
//! `policy`.
//!
//! - [`data`]: what the networks learn from
//! - [`nn`]: differentiable operations and networks, optimiser, parameters
//! - [`train`]: training loops with checkpoints
//! - [`models`]: the files of a trained model
//! - [`validate`]: errors on held-out demonstrations

pub mod benchmark;
pub mod data;
pub mod models;
pub mod nn;
pub mod train;
pub mod validate;
