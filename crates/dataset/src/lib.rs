//! Format of a dataset: demonstrations and point clouds in a folder in LeRobot's layout (paper §II-A).
//!
//! In: a folder. Out: rows, clouds, episodes, verification. Crate `datagen` writes it. Independent of physics,
//! planning and neural networks.

pub mod dataset;
pub mod episodes;
pub mod lerobot;
pub mod manifest;
pub mod parquet_io;
pub mod planar_pose;
pub mod shard;
mod verify;

pub use dataset::{Dataset, PoseRecord};
