//! Configurations of dataset generation and training, with their presets, as plain data.
//!
//! The command line, the job server and the training share them. Does not depend on physics, tensors or
//! files.

pub mod autoencoder;
pub mod dagger;
pub mod dataset;
pub mod start_net;

pub use autoencoder::AutoencoderConfig;
pub use dagger::{DaggerConfig, Gains};
pub use dataset::DatasetConfig;
pub use start_net::StartConfig;
