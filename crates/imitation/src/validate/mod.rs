//! Validation without physics: kinematic rollouts of the policy, linear probe and reconstructions of the
//! encoder.

pub mod jacobian_symmetry;
pub mod kinematic_rollout;
pub mod linear_probe;
pub mod reconstruction;
