//! Vocabulary of space: vectors, poses, point clouds, convex shapes and sampling.
//!
//! Lengths are in metres; frames are right-handed with z up. Independent of robots and physics.

pub mod convex_shape;
pub mod low_discrepancy;
pub mod point_cloud;
pub mod surface_sampling;

/// Vector or point (m), single precision.
pub type Vec3 = glamx::Vec3;
/// Rigid transform, single precision; `world_from_body` maps body coordinates to world coordinates.
pub type Pose = glamx::Pose3;
