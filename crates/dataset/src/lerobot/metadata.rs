//! Files in `meta`: features, statistics, tasks and episodes.

use super::frames::{ACTION_DIM, ENVIRONMENT_DIM};
use super::{FPS, FeatureStats, task};
use crate::parquet_io::{self, Column, Columns};
use crate::shard::{CLOUD_POINTS, DemoTrial, PoseShard, STATE_DIM};
use anyhow::Result;
use files::atomic_file;
use robot::KinematicTree;
use serde_json::{Value, json};
use std::path::Path;

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

/// Inputs of the files in `meta`.
pub struct Metadata<'a> {
    /// Robot, whose joints name the components of states and actions.
    pub tree: &'a KinematicTree,
    /// Names of the objects, one task each.
    pub objects: &'a [String],
    /// All episodes, in order.
    pub episodes: &'a [EpisodeIndex<'a>],
    /// Statistics of all rows.
    pub stats: &'a FeatureStats,
    /// Whether the rows have the column `observation.pointcloud`.
    pub has_point_cloud: bool,
}

/// Sizes (MB) at which LeRobot's tools start the next file. LeRobot rejects sizes that are not positive, also
/// in a dataset without video.
const MAX_DATA_FILE_MB: usize = 1000;
const MAX_VIDEO_FILE_MB: usize = 200;

impl Metadata<'_> {
    /// Writes the files in `meta`.
    pub fn write(&self, dir: &Path) -> Result<()> {
        let pretty = |value: &Value| serde_json::to_vec_pretty(value);
        atomic_file::write(&dir.join("meta/info.json"), &pretty(&self.info())?)?;
        atomic_file::write(&dir.join("meta/stats.json"), &pretty(&self.stats.json())?)?;
        write_tasks(&dir.join("meta/tasks.parquet"), self.objects)?;
        let path = dir.join("meta/episodes/chunk-000/file-000.parquet");
        parquet_io::write(&path, [Ok(self.episode_columns())], None)
    }

    /// Number of rows.
    pub fn num_rows(&self) -> usize {
        self.episodes.iter().map(|episode| episode.rows[1]).sum()
    }

    fn info(&self) -> Value {
        let episodes = self.episodes.len();
        json!({
            "codebase_version": "v3.0",
            "robot_type": self.tree.hand.name,
            "total_episodes": episodes,
            "total_frames": self.num_rows(),
            "total_tasks": self.objects.len(),
            "chunks_size": 1000,
            "data_files_size_in_mb": MAX_DATA_FILE_MB,
            "video_files_size_in_mb": MAX_VIDEO_FILE_MB,
            "fps": FPS,
            "splits": { "train": format!("0:{episodes}") },
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": null,
            "features": self.features(),
        })
    }

    fn features(&self) -> Value {
        let joints = |quantities: [&str; 2]| -> Vec<String> {
            let names = quantities.map(|quantity| {
                self.tree.joints.iter().map(move |joint| format!("{}.{quantity}", joint.name))
            });
            names.into_iter().flatten().collect()
        };
        let vector = |width: usize, names: Vec<String>| json!({ "dtype": "float32", "shape": [width], "names": names });
        let scalar = |dtype: &str| json!({ "dtype": dtype, "shape": [1], "names": null });
        let environment = ["x", "y", "yaw_sin", "yaw_cos", "extent_x", "extent_y", "extent_z"];
        let environment = environment.map(|name| format!("object.{name}")).to_vec();
        let mut features = json!({
            "observation.state": vector(STATE_DIM, joints(["position", "velocity"])),
            "observation.environment_state": vector(ENVIRONMENT_DIM, environment),
            "action": vector(ACTION_DIM, joints(["acceleration", "target"])),
            "timestamp": scalar("float32"),
            "frame_index": scalar("int64"),
            "episode_index": scalar("int64"),
            "index": scalar("int64"),
            "task_index": scalar("int64"),
        });
        if self.has_point_cloud {
            features["observation.pointcloud"] = json!({
                "dtype": "float32", "shape": [CLOUD_POINTS, 3], "names": ["point", "coordinate"],
            });
        }
        features
    }

    fn episode_columns(&self) -> Columns {
        let (objects, episodes) = (self.objects, self.episodes);
        let integers = |of: &dyn Fn(&EpisodeIndex) -> usize| {
            Column::Integers(episodes.iter().map(|episode| of(episode) as i64).collect())
        };
        let floats =
            |of: &dyn Fn(&EpisodeIndex) -> f32| Column::Floats(episodes.iter().map(of).collect());
        let tasks = episodes.iter().map(|episode| task(&objects[episode.object])).collect();
        let names = episodes.iter().map(|episode| objects[episode.object].clone()).collect();
        vec![
            ("episode_index", Column::Integers((0..episodes.len() as i64).collect())),
            ("tasks", Column::TextList(tasks)),
            ("length", integers(&|e| e.rows[1])),
            ("data/chunk_index", integers(&|_| 0)),
            ("data/file_index", integers(&|e| e.file)),
            ("dataset_from_index", integers(&|e| e.rows[0])),
            ("dataset_to_index", integers(&|e| e.rows[0] + e.rows[1])),
            ("meta/episodes/chunk_index", integers(&|_| 0)),
            ("meta/episodes/file_index", integers(&|_| 0)),
            ("object", Column::Texts(names)),
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
}

/// Writes the task table as pandas does, with the text as index: LeRobot looks up tasks by this index.
fn write_tasks(path: &Path, objects: &[String]) -> Result<()> {
    let column = |name: &str, pandas: &str, numpy: &str| {
        json!({
            "name": name, "field_name": name, "pandas_type": pandas, "numpy_type": numpy,
            "metadata": null,
        })
    };
    let pandas = json!({
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
        "pandas_version": "2.0.0",
    });
    let columns = vec![
        ("task_index", Column::Integers((0..objects.len() as i64).collect())),
        ("task", Column::Texts(objects.iter().map(|name| task(name)).collect())),
    ];
    parquet_io::write(path, [Ok(columns)], Some(("pandas", pandas.to_string())))
}
