//! LeRobot layout, version 3: rows of all episodes in Parquet files, and their metadata in `meta`.
//!
//! <https://huggingface.co/docs/lerobot/lerobot-dataset-v3>. Additional columns are specific to this project.

use crate::parquet_io::{self, Column, Columns};
use crate::shard::{DemoTrial, PoseShard, STATE_DIM};
use anyhow::Result;
use files::atomic_file;
use robot::integrator::CONTROL_DT;
use robot::{DOF, KinematicTree};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Rows per second.
const FPS: usize = 30;

/// Dimension of an action: joint accelerations, then the joint positions they lead to.
pub const ACTION_DIM: usize = 2 * DOF;

/// Path of a Parquet file with rows of episodes.
pub fn data_file_path(dir: &Path, file: usize) -> PathBuf {
    dir.join("data/chunk-000").join(format!("file-{file:03}.parquet"))
}

/// Location of an episode in the dataset.
pub struct EpisodeIndex<'a> {
    /// Index of the object in the configuration.
    pub object: usize,
    /// Index of the pose among the poses of the object.
    pub pose: usize,
    /// All data of the pose.
    pub shard: &'a PoseShard,
    /// The kept trial that is the episode.
    pub trial: &'a DemoTrial,
    /// Index of its Parquet file.
    pub file: usize,
    /// First row in the dataset, then number of rows.
    pub rows: [usize; 2],
}

/// Rows of all demonstrations at one pose. The first demonstration is episode `episode` and starts at row
/// `row` of the dataset.
pub fn frame_columns(shard: &PoseShard, object: usize, episode: usize, row: usize) -> Columns {
    let count = shard.num_rows();
    let (mut frame, mut episodes) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for (k, span) in shard.offsets.windows(2).enumerate() {
        frame.extend(0..(span[1] - span[0]) as i64);
        episodes.extend(std::iter::repeat_n((episode + k) as i64, span[1] - span[0]));
    }
    let timestamp = frame.iter().map(|i| (*i as f64 * CONTROL_DT) as f32).collect();
    let pairs = shard.accelerations.chunks_exact(DOF).zip(shard.targets.chunks_exact(DOF));
    let action = pairs.flat_map(|(qdd, target)| [qdd, target].concat()).collect();
    vec![
        ("observation.state", Column::Vectors(shard.states.clone(), STATE_DIM)),
        ("action", Column::Vectors(action, ACTION_DIM)),
        ("timestamp", Column::Floats(timestamp)),
        ("frame_index", Column::Integers(frame)),
        ("episode_index", Column::Integers(episodes)),
        ("index", Column::Integers((row..row + count).map(|i| i as i64).collect())),
        ("task_index", Column::Integers(vec![object as i64; count])),
    ]
}

/// Task description of the episodes with an object.
fn task(object: &str) -> String {
    format!("lift the {}", object.replace('_', " "))
}

/// Writes the metadata files in `meta`.
pub fn write_meta(
    dir: &Path,
    tree: &KinematicTree,
    objects: &[String],
    episodes: &[EpisodeIndex],
    stats: &[ColumnStats; 2],
) -> Result<()> {
    let frames: usize = episodes.iter().map(|episode| episode.rows[1]).sum();
    let info = info(tree, objects.len(), episodes.len(), frames);
    let pretty = |value: &Value| serde_json::to_vec_pretty(value);
    atomic_file::write(&dir.join("meta/info.json"), &pretty(&info)?)?;
    let [state, action] = stats;
    let stats = json!({ "observation.state": state.json(), "action": action.json() });
    atomic_file::write(&dir.join("meta/stats.json"), &pretty(&stats)?)?;
    write_tasks(&dir.join("meta/tasks.parquet"), objects)?;
    let path = dir.join("meta/episodes/chunk-000/file-000.parquet");
    parquet_io::write(&path, [Ok(episode_columns(objects, episodes))], None)
}

fn info(tree: &KinematicTree, tasks: usize, episodes: usize, frames: usize) -> Value {
    let names = |suffix: &str| -> Vec<String> {
        tree.joints.iter().map(|joint| format!("{}.{suffix}", joint.name)).collect()
    };
    let vector =
        |names: Vec<String>| json!({ "dtype": "float32", "shape": [names.len()], "names": names });
    let scalar = |dtype: &str| json!({ "dtype": dtype, "shape": [1], "names": null });
    json!({
        "codebase_version": "v3.0",
        "robot_type": tree.hand.name,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": 1000,
        "data_files_size_in_mb": 1000,
        "video_files_size_in_mb": 0,
        "fps": FPS,
        "splits": { "train": format!("0:{episodes}") },
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": null,
        "features": {
            "observation.state": vector([names("position"), names("velocity")].concat()),
            "action": vector([names("acceleration"), names("target")].concat()),
            "timestamp": scalar("float32"),
            "frame_index": scalar("int64"),
            "episode_index": scalar("int64"),
            "index": scalar("int64"),
            "task_index": scalar("int64"),
        },
    })
}

/// Writes the task table as pandas does, with the text as index.
fn write_tasks(path: &Path, objects: &[String]) -> Result<()> {
    let column = |name: Option<&str>, field: &str, pandas: &str, numpy: &str| {
        json!({
            "name": name, "field_name": field, "pandas_type": pandas, "numpy_type": numpy,
            "metadata": null,
        })
    };
    let pandas = json!({
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [
            column(Some("task_index"), "task_index", "int64", "int64"),
            column(Some("task"), "task", "unicode", "object"),
        ],
        "pandas_version": "2.0.0",
    });
    let columns = vec![
        ("task_index", Column::Integers((0..objects.len() as i64).collect())),
        ("task", Column::Texts(objects.iter().map(|name| task(name)).collect())),
    ];
    parquet_io::write(path, [Ok(columns)], Some(("pandas", pandas.to_string())))
}

fn episode_columns(objects: &[String], episodes: &[EpisodeIndex]) -> Columns {
    let integers = |of: &dyn Fn(&EpisodeIndex) -> usize| {
        Column::Integers(episodes.iter().map(|episode| of(episode) as i64).collect())
    };
    let floats =
        |of: &dyn Fn(&EpisodeIndex) -> f32| Column::Floats(episodes.iter().map(of).collect());
    let first: Vec<i64> = (0..episodes.len() as i64).collect();
    vec![
        ("episode_index", Column::Integers(first)),
        ("tasks", Column::TextList(episodes.iter().map(|e| task(&objects[e.object])).collect())),
        ("length", integers(&|e| e.rows[1])),
        ("data/chunk_index", integers(&|_| 0)),
        ("data/file_index", integers(&|e| e.file)),
        ("dataset_from_index", integers(&|e| e.rows[0])),
        ("dataset_to_index", integers(&|e| e.rows[0] + e.rows[1])),
        ("meta/episodes/chunk_index", integers(&|_| 0)),
        ("meta/episodes/file_index", integers(&|_| 0)),
        ("object", Column::Texts(episodes.iter().map(|e| objects[e.object].clone()).collect())),
        ("pose_index", integers(&|e| e.pose)),
        ("x", floats(&|e| e.shard.pose[0])),
        ("y", floats(&|e| e.shard.pose[1])),
        ("yaw", floats(&|e| e.shard.pose[2])),
        ("grasp", integers(&|e| e.trial.grasp)),
        ("target_seed", integers(&|e| e.trial.target)),
        ("contact_row", integers(&|e| e.trial.contact_row)),
        ("clearance", floats(&|e| e.trial.clearance)),
    ]
}

/// Count, sums, minima and maxima of vectors, by column.
#[derive(Clone, Debug)]
pub struct ColumnStats {
    count: usize,
    sum: Vec<f64>,
    sum_of_squares: Vec<f64>,
    min: Vec<f32>,
    max: Vec<f32>,
}

impl ColumnStats {
    /// Statistics of no vectors of `width` values.
    pub fn new(width: usize) -> Self {
        Self {
            count: 0,
            sum: vec![0.0; width],
            sum_of_squares: vec![0.0; width],
            min: vec![f32::INFINITY; width],
            max: vec![f32::NEG_INFINITY; width],
        }
    }

    /// Adds vectors of `width` values, stored in sequence, to the columns from `first` on.
    pub fn add(&mut self, vectors: &[f32], width: usize, first: usize) {
        for vector in vectors.chunks_exact(width) {
            for (i, &x) in (first..).zip(vector) {
                self.sum[i] += f64::from(x);
                self.sum_of_squares[i] += f64::from(x) * f64::from(x);
                (self.min[i], self.max[i]) = (self.min[i].min(x), self.max[i].max(x));
            }
        }
        self.count += if first == 0 { vectors.len() / width } else { 0 };
    }

    fn json(&self) -> Value {
        if self.count == 0 {
            // JSON cannot represent infinities.
            let zeros = vec![0.0; self.sum.len()];
            let of = || zeros.clone();
            return json!({ "min": of(), "max": of(), "mean": of(), "std": of(), "count": [0] });
        }
        let count = self.count as f64;
        let mean: Vec<f64> = self.sum.iter().map(|sum| sum / count).collect();
        let spread = self.sum_of_squares.iter().zip(&mean);
        let std: Vec<f64> =
            spread.map(|(sum, mean)| libm::sqrt((sum / count - mean * mean).max(0.0))).collect();
        json!({
            "min": self.min, "max": self.max, "mean": mean, "std": std, "count": [self.count],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn column_stats_match_values() {
        let mut moments = ColumnStats::new(3);
        moments.add(&[1.0, 2.0, 3.0, 6.0], 2, 0);
        moments.add(&[5.0, 7.0], 1, 2);
        let json = moments.json();
        assert_eq!(json["mean"], json!([2.0, 4.0, 6.0]));
        assert_eq!(json["std"], json!([1.0, 2.0, 1.0]));
        assert_eq!(
            (&json["min"], &json["max"]),
            (&json!([1.0, 2.0, 5.0]), &json!([3.0, 6.0, 7.0]))
        );
        assert_eq!(json["count"], json!([2]));
    }
}
