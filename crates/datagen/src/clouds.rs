//! Point clouds of objects from the simulated depth sensor, with and without noise.

use crate::poses::sample_azimuth;
use anyhow::{Context, Result};
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

/// Max. number of random poses or azimuths, until the sensor sees the object.
const MAX_LOOKS: usize = 16;

/// Renders point clouds with the depth sensor of the scene.
pub(crate) struct CloudRenderer<'a> {
    pub(crate) robot: &'a RobotContext,
    pub(crate) sensor: DepthSensor,
}

impl<'a> CloudRenderer<'a> {
    pub(crate) fn new(robot: &'a RobotContext) -> Self {
        Self { robot, sensor: DepthSensor::new(&robot.config, &robot.tree) }
    }

    /// Samples azimuths for an object pose and adds the clouds at each of them to `shard`. Returns whether the sensor
    /// sees the object at the pose; a thin rod may be too far away. Otherwise no clouds are added.
    pub(crate) fn render_azimuths(
        &self,
        object: &Object,
        [turns, clouds]: [usize; 2],
        shard: &mut PoseShard,
        rng: &mut impl Rng,
    ) -> bool {
        let pose = shard.pose;
        let azimuths: Vec<f32> = std::iter::once(0.0)
            .chain((1..turns).map(|_| sample_azimuth(self.robot, pose, rng)))
            .collect();
        let Some(first) = self.render_views(object, pose, clouds, rng) else { return false };
        let mut all = vec![(0.0, first.clone())];
        for mut turn in azimuths.into_iter().skip(1) {
            let visible = (0..MAX_LOOKS).find_map(|look| {
                if look > 0 {
                    turn = sample_azimuth(self.robot, pose, rng);
                }
                let views = self.render_views(object, rotate_pose(pose, turn), clouds, rng)?;
                Some((turn, views))
            });
            all.push(visible.unwrap_or_else(|| (0.0, first.clone())));
        }
        for (turn, [clean, noisy]) in all {
            shard.azimuths.push(turn);
            shard.clean.extend(clean);
            shard.noisy.extend(noisy);
        }
        true
    }

    /// The clean cloud and the noisy clouds at a pose. `None` if the sensor does not see the object in one of them.
    fn render_views(
        &self,
        object: &Object,
        pose: [f32; 3],
        count: usize,
        rng: &mut impl Rng,
    ) -> Option<[Vec<f32>; 2]> {
        let clean = self.render_clean(object, pose)?;
        let noisy: Option<Vec<_>> =
            (0..count).map(|_| self.render_noisy(object, pose, rng)).collect();
        Some([clean, noisy?.concat()])
    }

    /// Encodes `count` clouds of an object at random poses on the table where the sensor sees it, the training data of
    /// the encoder: noisy clouds, clean clouds, and the poses x, y (m), yaw (rad).
    pub(crate) fn render_random_poses(
        &self,
        object: &Object,
        count: usize,
        rng: &mut impl Rng,
    ) -> Result<Vec<u8>> {
        let (mut noisy, mut clean, mut poses) = (vec![], vec![], vec![]);
        for _ in 0..count {
            let view = (0..MAX_LOOKS).find_map(|_| {
                let pose = object_poses::sample_planar_pose(self.robot, rng);
                Some((pose, self.render_views(object, pose, 1, rng)?))
            });
            let (pose, [clean_view, noisy_view]) = view.with_context(|| {
                format!(
                    "the depth sensor does not see {} at {MAX_LOOKS} random poses; the object may be too small",
                    object.name
                )
            })?;
            poses.extend(pose);
            clean.extend(clean_view);
            noisy.extend(noisy_view);
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

    fn render_clean(&self, object: &Object, pose: [f32; 3]) -> Option<Vec<f32>> {
        self.extract_cloud(&self.sensor.render(&object.mesh, &self.object_pose(pose)))
    }

    fn render_noisy(
        &self,
        object: &Object,
        pose: [f32; 3],
        rng: &mut impl Rng,
    ) -> Option<Vec<f32>> {
        self.extract_cloud(&self.sensor.capture(&object.mesh, &self.object_pose(pose), rng))
    }

    fn object_pose(&self, [x, y, yaw]: [f32; 3]) -> Pose {
        self.robot.config.object_pose(x, y, yaw)
    }

    /// Point cloud of one frame as a flat array of x, y, z; `None` if it shows no object.
    fn extract_cloud(&self, frame: &DepthImage) -> Option<Vec<f32>> {
        let cloud = self.sensor.extract_cloud(frame);
        let is_complete = cloud.len() == CLOUD_POINTS;
        is_complete.then(|| cloud.iter().flat_map(|p| p.to_array()).collect())
    }
}
