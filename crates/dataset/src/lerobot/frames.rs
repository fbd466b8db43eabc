//! Rows of the data files.

use crate::parquet_io::{Column, Columns};
use crate::shard::{CLOUD_POINTS, PoseShard, STATE_DIM};
use robot::DOF;
use robot::integrator::CONTROL_DT;

/// Dimension of an action: joint accelerations, then the joint positions they lead to.
pub const ACTION_DIM: usize = 2 * DOF;

/// Dimension of the environment state: x, y (m), sine and cosine of yaw, extents of the object (m).
pub const ENVIRONMENT_DIM: usize = 7;

/// Rows of all demonstrations at one object pose.
pub struct PoseFrames<'a> {
    /// All data of the pose.
    pub shard: &'a PoseShard,
    /// Index of the object in the configuration, which is the index of the task.
    pub object: usize,
    /// Extents (m) of the object's bounding box at yaw 0.
    pub extents: [f32; 3],
    /// Index of the first episode in the dataset.
    pub episode: usize,
    /// Index of the first row in the dataset.
    pub row: usize,
    /// Whether to add the column `observation.pointcloud`.
    pub has_point_cloud: bool,
}

impl PoseFrames<'_> {
    /// Columns of the rows, in the order of the features in `meta/info.json`.
    pub fn columns(&self) -> Columns {
        let shard = self.shard;
        let count = shard.num_rows();
        let (mut frame, mut episodes) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (k, span) in shard.offsets.windows(2).enumerate() {
            frame.extend(0..(span[1] - span[0]) as i64);
            episodes.extend(std::iter::repeat_n((self.episode + k) as i64, span[1] - span[0]));
        }
        let timestamp = frame.iter().map(|i| (*i as f64 * CONTROL_DT) as f32).collect();
        let pairs = shard.accelerations.chunks_exact(DOF).zip(shard.targets.chunks_exact(DOF));
        let action = pairs.flat_map(|(qdd, target)| [qdd, target].concat()).collect();
        let environment = self.environment_state().repeat(count);
        let mut columns = vec![
            ("observation.state", Column::Vectors(shard.states.clone(), STATE_DIM)),
            ("observation.environment_state", Column::Vectors(environment, ENVIRONMENT_DIM)),
        ];
        if self.has_point_cloud {
            columns.push(("observation.pointcloud", Column::Clouds(self.clouds(), CLOUD_POINTS)));
        }
        let rows = self.row..self.row + count;
        columns.extend([
            ("action", Column::Vectors(action, ACTION_DIM)),
            ("timestamp", Column::Floats(timestamp)),
            ("frame_index", Column::Integers(frame)),
            ("episode_index", Column::Integers(episodes)),
            ("index", Column::Integers(rows.map(|i| i as i64).collect())),
            ("task_index", Column::Integers(vec![self.object as i64; count])),
        ]);
        columns
    }

    /// Sine and cosine instead of yaw: yaw jumps at ±180°.
    fn environment_state(&self) -> [f32; ENVIRONMENT_DIM] {
        let ([x, y, yaw], [width, depth, height]) = (self.shard.pose, self.extents);
        [x, y, libm::sinf(yaw), libm::cosf(yaw), width, depth, height]
    }

    /// One noisy cloud for each episode, repeated in each of its rows. Consecutive episodes use different
    /// clouds, of those that were rendered at azimuth 0.
    fn clouds(&self) -> Vec<f32> {
        let PoseShard { noisy, azimuths, offsets, .. } = self.shard;
        let size = 3 * CLOUD_POINTS;
        let at_azimuth_0 = &noisy[..noisy.len() / azimuths.len().max(1)];
        let clouds = at_azimuth_0.chunks_exact(size).cycle();
        let spans = offsets.windows(2).map(|span| span[1] - span[0]);
        spans.zip(clouds).flat_map(|(rows, cloud)| cloud.repeat(rows)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two episodes of 2 rows and 1 row; two azimuths with two clouds each.
    fn shard() -> PoseShard {
        let cloud = |value: f32| vec![value; 3 * CLOUD_POINTS];
        PoseShard {
            pose: [0.5, -0.1, std::f32::consts::FRAC_PI_2],
            offsets: vec![0, 2, 3],
            states: vec![0.0; 3 * STATE_DIM],
            accelerations: vec![1.0; 3 * DOF],
            targets: vec![2.0; 3 * DOF],
            azimuths: vec![0.0, 1.0],
            noisy: [1.0, 2.0, 3.0, 4.0].map(cloud).concat(),
            ..PoseShard::default()
        }
    }

    fn column(has_point_cloud: bool, name: &str) -> Option<Column> {
        let shard = shard();
        let frames = PoseFrames {
            shard: &shard,
            object: 4,
            extents: [0.1, 0.2, 0.3],
            episode: 7,
            row: 100,
            has_point_cloud,
        };
        frames.columns().into_iter().find(|(of, _)| *of == name).map(|(_, column)| column)
    }

    #[test]
    fn rows_continue_the_numbering_of_the_dataset() {
        let integers = |name: &str| match column(false, name) {
            Some(Column::Integers(values)) => values,
            _ => panic!("{name} is not a column of integers"),
        };
        assert_eq!(integers("frame_index"), [0, 1, 0]);
        assert_eq!(integers("episode_index"), [7, 7, 8]);
        assert_eq!(integers("index"), [100, 101, 102]);
        assert_eq!(integers("task_index"), [4, 4, 4]);
    }

    #[test]
    fn environment_state_has_pose_and_extents_in_each_row() {
        let Some(Column::Vectors(values, ENVIRONMENT_DIM)) =
            column(false, "observation.environment_state")
        else {
            panic!("no environment state");
        };
        assert_eq!(values.len(), 3 * ENVIRONMENT_DIM);
        for row in values.chunks_exact(ENVIRONMENT_DIM) {
            assert_eq!(row[..3], [0.5, -0.1, 1.0]);
            assert!(row[3].abs() < 1e-7, "cosine of 90 degrees: {}", row[3]);
            assert_eq!(row[4..], [0.1, 0.2, 0.3]);
        }
    }

    #[test]
    fn episodes_take_turns_with_the_clouds_at_azimuth_0() {
        assert!(column(false, "observation.pointcloud").is_none());
        let Some(Column::Clouds(values, CLOUD_POINTS)) = column(true, "observation.pointcloud")
        else {
            panic!("no point cloud");
        };
        let first_of_row: Vec<f32> = values.chunks_exact(3 * CLOUD_POINTS).map(|x| x[0]).collect();
        assert_eq!(first_of_row, [1.0, 1.0, 2.0]);
    }
}
