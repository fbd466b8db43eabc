//! Point clouds of objects from the simulated depth sensor, with and without noise.

use crate::poses::sample_azimuth;
use anyhow::{Result, ensure};
use dataset::planar_pose::rotate_pose;
use dataset::shard::{CLOUD_POINTS, PoseShard};
use files::tensors;
use geometry::Pose;
use grasps::RobotContext;
use grasps::plan::object_poses;
use objects::object::Object;
use rand::Rng;
use scene::depth_camera::DepthImage;
use scene::depth_sensor::DepthSensor;

/// Renders point clouds with the depth sensor of the scene.
pub(crate) struct CloudRenderer<'a> {
    pub(crate) robot: &'a RobotContext,
    pub(crate) sensor: DepthSensor,
}

impl<'a> CloudRenderer<'a> {
    pub(crate) fn new(robot: &'a RobotContext) -> Self {
        Self { robot, sensor: DepthSensor::new(&robot.config, &robot.tree) }
    }

    /// Samples azimuths for an object pose and adds the clouds at each of them to `shard`.
    pub(crate) fn render_azimuths(
        &self,
        object: &Object,
        [turns, clouds]: [usize; 2],
        shard: &mut PoseShard,
        rng: &mut impl Rng,
    ) -> Result<()> {
        shard.azimuths = std::iter::once(0.0)
            .chain((1..turns).map(|_| sample_azimuth(self.robot, shard.pose, rng)))
            .collect();
        for turn in &shard.azimuths {
            let pose = rotate_pose(shard.pose, *turn);
            shard.clean.extend(self.render_clean(object, pose)?);
            for _ in 0..clouds {
                shard.noisy.extend(self.render_noisy(object, pose, rng)?);
            }
        }
        Ok(())
    }

    /// Encodes `count` clouds of an object at random poses on the table, the training data of the encoder:
    /// noisy clouds, clean clouds, and the poses x, y (m), yaw (rad).
    pub(crate) fn render_random_poses(
        &self,
        object: &Object,
        count: usize,
        rng: &mut impl Rng,
    ) -> Result<Vec<u8>> {
        let (mut noisy, mut clean, mut poses) = (vec![], vec![], vec![]);
        for _ in 0..count {
            let pose = object_poses::sample_planar_pose(self.robot, rng);
            poses.extend(pose);
            clean.extend(self.render_clean(object, pose)?);
            noisy.extend(self.render_noisy(object, pose, rng)?);
        }
        tensors::encode(
            &[
                ("noisy", vec![count, CLOUD_POINTS, 3], &noisy),
                ("clean", vec![count, CLOUD_POINTS, 3], &clean),
                ("poses", vec![count, 3], &poses),
            ],
            None,
        )
    }

    fn render_clean(&self, object: &Object, pose: [f32; 3]) -> Result<Vec<f32>> {
        let frame = self.sensor.render(&object.mesh, &self.object_pose(pose));
        self.extract_cloud(object, pose, &frame)
    }

    fn render_noisy(
        &self,
        object: &Object,
        pose: [f32; 3],
        rng: &mut impl Rng,
    ) -> Result<Vec<f32>> {
        let frame = self.sensor.capture(&object.mesh, &self.object_pose(pose), rng);
        self.extract_cloud(object, pose, &frame)
    }

    fn object_pose(&self, [x, y, yaw]: [f32; 3]) -> Pose {
        self.robot.config.object_pose(x, y, yaw)
    }

    /// Point cloud of one frame as a flat array of x, y, z.
    fn extract_cloud(
        &self,
        object: &Object,
        [x, y, _]: [f32; 3],
        frame: &DepthImage,
    ) -> Result<Vec<f32>> {
        let cloud = self.sensor.extract_cloud(frame);
        ensure!(
            cloud.len() == CLOUD_POINTS,
            "the depth sensor does not see {} at x {x}, y {y}; the object may be too small",
            object.name
        );
        Ok(cloud.iter().flat_map(|p| p.to_array()).collect())
    }
}
