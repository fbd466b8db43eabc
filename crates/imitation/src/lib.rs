//! Learning by imitation: dataset, surrogate expert, differentiable networks, DAgger.
//!
//! Offline: candle trains here, and the networks that run elsewhere are held to these by tests.

pub mod dataset;
pub mod evaluation;
pub mod store;
