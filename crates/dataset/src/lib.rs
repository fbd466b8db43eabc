//! Generates datasets of grasps, demonstrations that lift the object in replay, and point clouds (paper
//! §II-A).
//!
//! In: objects and a configuration. Out: a folder in LeRobot's layout. Does not depend on neural networks.

mod assemble;
mod clouds;
pub mod dataset;
mod demonstrations;
pub mod episodes;
pub mod generate;
mod lerobot;
mod manifest;
mod parquet_io;
pub mod poses;
pub mod report;
pub mod shard;
mod summary;
mod verify;

pub use dataset::{Dataset, PoseRecord};
pub use generate::{Objects, Progress};
