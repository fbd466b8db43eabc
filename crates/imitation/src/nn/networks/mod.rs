//! Differentiable counterparts of the networks in `policy`.

pub mod acceleration_mlp;
pub mod autoencoder;
pub mod network;
pub mod ngf;
