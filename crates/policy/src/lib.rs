//! Inference of the policies: point cloud -> azimuth and z, then (q, q̇, z) -> q̈ (paper §III-B, §III-D).
//!
//! - q, q̇, q̈: positions (rad), velocities (rad/s) and accelerations (rad/s²) of the 23 joints.
//! - Azimuth: angle (rad) of the object about the robot's vertical axis.
//! - z: 32 numbers that encode the point cloud, whitened to unit variance along their principal axes.
//! - Canonical frame: the base frame rotated about the vertical axis, so that the object is at azimuth 0. The
//!   networks act in it; the first joint is shifted by the azimuth.
//!
//! [`Model::observe`] encodes a cloud once per attempt; [`Network::acceleration`] computes q̈ at each step. The
//! networks are in [`networks`], and [`StartModel`] selects the joint positions where the policy starts.
//!
//! Plain Rust with a fixed order of every sum, so that an attempt has the same bits natively and in the
//! browser. Training uses other code, in `imitation`; tests compare both.

pub mod encoder;
pub mod kinematic_rollout;
pub mod model;
pub mod networks;
pub mod observation;
pub mod simd;
pub mod start_model;
pub mod weights;
pub mod whitening;

pub use encoder::Encoder;
pub use model::Model;
pub use networks::ngf::Ngf;
pub use networks::{Network, NetworkInput, ObservationKind, PolicyConfig};
pub use observation::Observation;
pub use start_model::StartModel;
pub use weights::WeightsError;
pub use whitening::Whitening;

/// Dimension of z, the encoding of a point cloud.
pub const LATENT_DIM: usize = 32;
