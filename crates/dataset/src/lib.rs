//! The data engine: grasps, demonstrations that lift when they are replayed, clouds; on disk for anyone (paper §II-A).
//!
//! In: objects and a configuration. Out: a folder in LeRobot's layout. Knows nothing of networks.

mod assemble;
mod clouds;
pub mod config;
mod demonstrations;
pub mod episodes;
pub mod folder;
pub mod generate;
mod lerobot;
pub mod manifest;
pub mod part;
pub mod poses;
pub mod report;
pub mod store;
pub mod summary;
mod table;
mod verify;

pub use config::DatasetConfig;
pub use folder::{Dataset, PoseRecord};
pub use generate::{Objects, Observer};
pub use manifest::Manifest;
