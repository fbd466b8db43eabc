//! LeRobot layout, version 3: rows of all episodes in Parquet files, and their metadata in `meta`.
//!
//! <https://huggingface.co/docs/lerobot/lerobot-dataset-v3>. Additional columns are specific to this project.

mod card;
mod feature_stats;
mod frames;
mod metadata;

pub use card::{CARD_FILE, card};
pub use feature_stats::{FeatureRanges, FeatureStats};
pub use frames::{ACTION_DIM, ENVIRONMENT_DIM, PoseFrames};
pub use metadata::{EpisodeIndex, Metadata};

use std::path::{Path, PathBuf};

/// Rows per second.
const FPS: usize = 30;

/// Path of a Parquet file with rows of episodes.
pub fn data_file_path(dir: &Path, file: usize) -> PathBuf {
    dir.join("data/chunk-000").join(format!("file-{file:03}.parquet"))
}

/// Task description of the episodes with an object.
fn task(object: &str) -> String {
    format!("lift the {}", object.replace('_', " "))
}
