//! Training loops: autoencoder, DAgger with the surrogate expert, start network.

pub mod autoencoder;
pub mod backward;
pub mod callback;
pub mod checkpoint;
pub mod dagger;
pub mod data_parallel;
pub mod expert;
pub mod loss;
pub mod start_net;
pub(crate) mod supervised;
