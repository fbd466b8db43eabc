//! Learning by imitation: surrogate expert, differentiable networks, DAgger.
//!
//! Offline: candle trains here, and the networks that run elsewhere are held to these by tests.

pub mod autoencoder;
pub mod benchmark;
pub mod checkpoint;
pub mod dagger;
pub mod encoder;
pub mod evaluation;
pub mod expert;
mod fit;
pub mod free_rollout;
pub mod lesson;
pub mod loss;
pub mod model_files;
pub mod moments;
mod nearest;
pub mod nn;
pub mod readout;
pub mod reconstruction;
pub mod shards;
pub mod split;
pub mod spread;
pub mod start;
pub mod step;
pub mod suite;
mod visits;
pub mod watcher;
