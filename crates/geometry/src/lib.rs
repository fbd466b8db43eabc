//! Words for space: poses, lofts, meshes and point clouds.
//!
//! Lengths are metres and frames are right-handed with z up. Knows nothing of robots or physics.

pub mod brought;
pub mod catalog;
pub mod cloud;
pub mod loft;
pub mod mesh;
pub mod object;
pub mod proportions;
pub mod sequence;
pub mod solid;
pub mod surface;
pub mod symmetry;

/// A vector or point in space (m), single precision.
pub type Vec3 = glamx::Vec3;
/// A rigid transform in space, single precision; `world_from_body` maps body coordinates to world coordinates.
pub type Pose = glamx::Pose3;
