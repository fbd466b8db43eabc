//! Learning by imitation: surrogate expert, differentiable networks, DAgger.
//!
//! Offline: candle trains here, and the networks that run elsewhere are held to these by tests.

pub mod autoencoder;
pub mod benchmark;
pub mod checkpoint;
pub mod dagger;
pub mod evaluation;
pub mod expert;
mod fit;
pub mod lesson;
pub mod loss;
pub mod moments;
mod nearest;
pub mod nn;
pub mod readout;
pub mod reconstruction;
pub mod shards;
pub mod start;
pub mod step;
pub mod suite;
pub mod training;
mod visits;
pub mod watcher;
