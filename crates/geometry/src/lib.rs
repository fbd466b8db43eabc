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
///
/// ```rust
/// use geometry::{Pose, Vec3};
/// // A body 0.5 m in front of the base, rotated by 90 degrees about z.
/// let world_from_body = Pose::new(Vec3::X * 0.5, Vec3::Z * std::f32::consts::FRAC_PI_2);
/// let in_body = Vec3::new(0.1, 0.0, 0.0);
/// let in_world = world_from_body * in_body;
/// assert!(in_world.distance(Vec3::new(0.5, 0.1, 0.0)) < 1e-6);
/// assert!((world_from_body.inverse() * in_world).distance(in_body) < 1e-6);
/// ```
pub type Pose = glamx::Pose3;
