//! Generates datasets: grasps, demonstrations that lift the object in replay, and point clouds (paper §II-A).
//!
//! In: objects and a configuration. Out: a folder that crate `dataset` reads, and an HTML report. Does not
//! depend on neural networks.

mod adapted_grasps;
mod assemble;
mod clouds;
mod demonstrations;
mod generate;
mod grasp_options;
mod grasp_order;
pub mod poses;
pub mod report;
mod shared_grasps;
mod summary;

pub use adapted_grasps::{AdaptationSource, PolicyEnds};
pub use generate::{adapt, create, generate, provenance, read_grasp_ratings, read_grasps};
