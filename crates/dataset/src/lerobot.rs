//! LeRobot's layout, version 3: rows of all episodes in Parquet, and what `meta` says about them.
//!
//! <https://huggingface.co/docs/lerobot/lerobot-dataset-v3>. Columns beyond the layout's are ours.

use crate::part::{Attempt, Part, STATE};
use crate::store;
use crate::table::{self, Column, Columns};
use anyhow::Result;
use robot::{DOF, Tree};
use scene::config::CONTROL_PERIOD;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Rows a second.
const FPS: usize = 30;

/// Numbers in an action: joint accelerations and the joint positions that they lead to.
pub(crate) const ACTION: usize = 2 * DOF;

/// Path of a file of rows.
pub(crate) fn data_path(dir: &Path, file: usize) -> PathBuf {
    dir.join("data/chunk-000").join(format!("file-{file:03}.parquet"))
}

/// Where an episode stands in the dataset.
pub(crate) struct Episode<'a> {
    pub(crate) object: usize,
    pub(crate) pose: usize,
    pub(crate) part: &'a Part,
    pub(crate) attempt: &'a Attempt,
    /// File of its rows.
    pub(crate) file: usize,
    /// First row in the dataset, and number of rows.
    pub(crate) rows: [usize; 2],
}

/// Rows of all demonstrations at one pose, the first of which is episode `episode` and begins at row `row` of
/// the dataset.
pub(crate) fn rows(part: &Part, object: usize, episode: usize, row: usize) -> Columns {
    let count = part.rows();
    let (mut frame, mut episodes) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for (k, span) in part.offsets.windows(2).enumerate() {
        frame.extend(0..(span[1] - span[0]) as i64);
        episodes.extend(std::iter::repeat_n((episode + k) as i64, span[1] - span[0]));
    }
    let timestamp = frame.iter().map(|i| (*i as f64 * CONTROL_PERIOD) as f32).collect();
    let pairs = part.accelerations.chunks_exact(DOF).zip(part.targets.chunks_exact(DOF));
    let action = pairs.flat_map(|(qdd, target)| [qdd, target].concat()).collect();
    vec![
        ("observation.state", Column::Vectors(part.states.clone(), STATE)),
        ("action", Column::Vectors(action, ACTION)),
        ("timestamp", Column::Floats(timestamp)),
        ("frame_index", Column::Integers(frame)),
        ("episode_index", Column::Integers(episodes)),
        ("index", Column::Integers((row..row + count).map(|i| i as i64).collect())),
        ("task_index", Column::Integers(vec![object as i64; count])),
    ]
}

/// What is asked for in the episodes with an object.
fn task(object: &str) -> String {
    format!("lift the {}", object.replace('_', " "))
}

/// Writes what `meta` says about the episodes.
pub(crate) fn write_meta(
    dir: &Path,
    tree: &Tree,
    objects: &[String],
    episodes: &[Episode],
    stats: &[Moments; 2],
) -> Result<()> {
    let frames: usize = episodes.iter().map(|episode| episode.rows[1]).sum();
    let info = info(tree, objects.len(), episodes.len(), frames);
    let pretty = |value: &Value| serde_json::to_vec_pretty(value);
    store::write(&dir.join("meta/info.json"), &pretty(&info)?)?;
    let [state, action] = stats;
    let stats = json!({ "observation.state": state.json(), "action": action.json() });
    store::write(&dir.join("meta/stats.json"), &pretty(&stats)?)?;
    write_tasks(&dir.join("meta/tasks.parquet"), objects)?;
    let path = dir.join("meta/episodes/chunk-000/file-000.parquet");
    table::write(&path, [Ok(episode_columns(objects, episodes))], None)
}

fn info(tree: &Tree, tasks: usize, episodes: usize, frames: usize) -> Value {
    let names = |suffix: &str| -> Vec<String> {
        tree.joints.iter().map(|joint| format!("{}.{suffix}", joint.name)).collect()
    };
    let vector =
        |names: Vec<String>| json!({ "dtype": "float32", "shape": [names.len()], "names": names });
    let scalar = |dtype: &str| json!({ "dtype": dtype, "shape": [1], "names": null });
    json!({
        "codebase_version": "v3.0",
        "robot_type": "kuka_iiwa7_allegro",
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

/// Tasks as pandas writes them: the text is the index.
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
    table::write(path, [Ok(columns)], Some(("pandas", pandas.to_string())))
}

fn episode_columns(objects: &[String], episodes: &[Episode]) -> Columns {
    let integers = |of: &dyn Fn(&Episode) -> usize| {
        Column::Integers(episodes.iter().map(|episode| of(episode) as i64).collect())
    };
    let floats = |of: &dyn Fn(&Episode) -> f32| Column::Floats(episodes.iter().map(of).collect());
    let first: Vec<i64> = (0..episodes.len() as i64).collect();
    vec![
        ("episode_index", Column::Integers(first)),
        ("tasks", Column::OneText(episodes.iter().map(|e| task(&objects[e.object])).collect())),
        ("length", integers(&|e| e.rows[1])),
        ("data/chunk_index", integers(&|_| 0)),
        ("data/file_index", integers(&|e| e.file)),
        ("dataset_from_index", integers(&|e| e.rows[0])),
        ("dataset_to_index", integers(&|e| e.rows[0] + e.rows[1])),
        ("meta/episodes/chunk_index", integers(&|_| 0)),
        ("meta/episodes/file_index", integers(&|_| 0)),
        ("object", Column::Texts(episodes.iter().map(|e| objects[e.object].clone()).collect())),
        ("pose_index", integers(&|e| e.pose)),
        ("x", floats(&|e| e.part.pose[0])),
        ("y", floats(&|e| e.part.pose[1])),
        ("yaw", floats(&|e| e.part.pose[2])),
        ("grasp", integers(&|e| e.attempt.grasp)),
        ("target_seed", integers(&|e| e.attempt.target)),
        ("touch", integers(&|e| e.attempt.touch)),
        ("clearance", floats(&|e| e.attempt.clearance)),
    ]
}

/// Count, sums and extremes of vectors, column by column.
#[derive(Clone, Debug)]
pub(crate) struct Moments {
    count: usize,
    sum: Vec<f64>,
    squares: Vec<f64>,
    min: Vec<f32>,
    max: Vec<f32>,
}

impl Moments {
    pub(crate) fn new(width: usize) -> Self {
        Self {
            count: 0,
            sum: vec![0.0; width],
            squares: vec![0.0; width],
            min: vec![f32::INFINITY; width],
            max: vec![f32::NEG_INFINITY; width],
        }
    }

    /// Adds vectors that stand one after another, from their `first` column on.
    pub(crate) fn add(&mut self, vectors: &[f32], width: usize, first: usize) {
        for vector in vectors.chunks_exact(width) {
            for (i, &x) in (first..).zip(vector) {
                self.sum[i] += f64::from(x);
                self.squares[i] += f64::from(x) * f64::from(x);
                (self.min[i], self.max[i]) = (self.min[i].min(x), self.max[i].max(x));
            }
        }
        self.count += if first == 0 { vectors.len() / width } else { 0 };
    }

    fn json(&self) -> Value {
        if self.count == 0 {
            // JSON has no infinities.
            let zeros = vec![0.0; self.sum.len()];
            let of = || zeros.clone();
            return json!({ "min": of(), "max": of(), "mean": of(), "std": of(), "count": [0] });
        }
        let count = self.count as f64;
        let mean: Vec<f64> = self.sum.iter().map(|sum| sum / count).collect();
        let spread = self.squares.iter().zip(&mean);
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
    fn moments_are_those_of_the_numbers() {
        let mut moments = Moments::new(3);
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
