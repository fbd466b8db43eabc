//! Imitation learning of the networks in `policy`, offline.
//!
//! In: a dataset and a configuration. Out: the weights and start configurations of a model. The steps, in
//! order:
//!
//! 1. [`train::autoencoder::train`] learns the encoder: point cloud -> z, 32 numbers.
//! 2. [`data::split::train_val_split`] groups the demonstrations and encodes their clouds.
//! 3. [`train::dagger::train`] learns the policy. DAgger rolls out the current policy, without physics, and
//!    labels the visited states with the acceleration of an expert. The surrogate expert ([`train::expert`])
//!    is a controller that follows the nearest demonstration; a person is not needed.
//! 4. [`models::export`] writes the files of the model. [`train::start_net`] can replace the table of start
//!    configurations, the joint positions where a policy starts, by a network.
//!
//! The networks are trained with candle, a tensor library; parity tests compare them with the inference code
//! in `policy`. A row of a demonstration is the state of one control period (1/30 s): 23 joint positions
//! (rad), then 23 velocities (rad/s).
//!
//! - [`benchmark`]: time of a training step
//! - [`data`]: demonstrations, their split, and the states that the policy visits
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
