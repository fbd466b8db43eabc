//! Trained models: the encoder, and the three files of a policy.

pub mod encoder;
pub mod export;
