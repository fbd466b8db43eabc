//! Validation without physics: kinematic rollouts, linear probe, reconstruction figure.

pub mod kinematic_rollout;
pub mod linear_probe;
pub mod reconstruction;
