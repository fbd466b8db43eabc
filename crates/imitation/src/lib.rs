//! Imitation learning: surrogate expert, differentiable networks, DAgger.
//!
//! Runs offline. The networks are trained with candle; parity tests compare them with the inference code in
//! `policy`.

pub mod autoencoder;
pub mod backward;
pub mod benchmark;
pub mod callback;
pub mod checkpoint;
pub mod dagger;
pub mod data_parallel;
pub mod demo_group;
pub mod encoder;
pub mod expert;
pub mod export;
pub mod kinematic_rollout;
pub mod linear_probe;
pub mod loss;
mod nearest_neighbor;
pub mod nn;
pub mod reconstruction;
mod rollout_buffer;
pub mod shape_moments;
pub mod split;
pub mod start_net;
mod supervised;
