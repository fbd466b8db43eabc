//! Objects: the built-in catalogue, shape variants, and the import of mesh files.
//!
//! In: lofts of `assets/objects`, or the bytes of a mesh file with [`import::ImportOptions`]. Out: an
//! [`Object`] with mesh, convex parts, mass and friction, at rest on z = 0.

pub mod catalog;
pub mod generated;
pub mod import;
pub mod loft;
pub mod object;
mod object_bytes;
mod orientation;
mod resting_pose;
pub mod shape_class;
pub mod shape_moments;
pub mod shape_variant;
pub mod solid;
pub mod symmetry;

pub use object::Object;
