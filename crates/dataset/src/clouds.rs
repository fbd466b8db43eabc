//! Point clouds of objects, as the camera measures them: with its noise, and without.

use crate::part::{CLOUD, Part};
use crate::poses::{draw_turn, turned};
use crate::store;
use anyhow::{Result, ensure};
use geometry::Pose;
use geometry::object::Object;
use grasps::{Robot, place};
use rand::Rng;
use scene::camera::DepthImage;
use scene::cloud::Eye;

/// The camera before the robot.
pub(crate) struct Viewer<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) eye: Eye,
}

impl<'a> Viewer<'a> {
    pub(crate) fn new(robot: &'a Robot) -> Self {
        Self { robot, eye: Eye::new(&robot.config, &robot.tree) }
    }

    /// Draws bearings for an object pose and adds the clouds there to `part`.
    pub(crate) fn look_around(
        &self,
        object: &Object,
        [turns, clouds]: [usize; 2],
        part: &mut Part,
        rng: &mut impl Rng,
    ) -> Result<()> {
        part.turns = std::iter::once(0.0)
            .chain((1..turns).map(|_| draw_turn(self.robot, part.pose, rng)))
            .collect();
        for turn in &part.turns {
            let pose = turned(part.pose, *turn);
            part.clean.extend(self.clean(object, pose)?);
            for _ in 0..clouds {
                part.noisy.extend(self.noisy(object, pose, rng)?);
            }
        }
        Ok(())
    }

    /// Bytes of `count` clouds of an object anywhere on the table, as the encoder learns from: noisy, without
    /// noise, and the poses x, y (m), yaw (rad).
    pub(crate) fn anywhere(
        &self,
        object: &Object,
        count: usize,
        rng: &mut impl Rng,
    ) -> Result<Vec<u8>> {
        let (mut noisy, mut clean, mut poses) = (vec![], vec![], vec![]);
        for _ in 0..count {
            let pose = place::random_pose(self.robot, rng);
            poses.extend(pose);
            clean.extend(self.clean(object, pose)?);
            noisy.extend(self.noisy(object, pose, rng)?);
        }
        store::encode(
            &[
                ("noisy", vec![count, CLOUD, 3], &noisy),
                ("clean", vec![count, CLOUD, 3], &clean),
                ("poses", vec![count, 3], &poses),
            ],
            None,
        )
    }

    fn clean(&self, object: &Object, pose: [f32; 3]) -> Result<Vec<f32>> {
        let frame = self.eye.clean_frame(&object.mesh, &self.place(pose));
        self.cloud(object, pose, &frame)
    }

    fn noisy(&self, object: &Object, pose: [f32; 3], rng: &mut impl Rng) -> Result<Vec<f32>> {
        let frame = self.eye.frame(&object.mesh, &self.place(pose), rng);
        self.cloud(object, pose, &frame)
    }

    fn place(&self, [x, y, yaw]: [f32; 3]) -> Pose {
        self.robot.config.upright(x, y, yaw)
    }

    /// The cloud of one frame, points one after another.
    fn cloud(&self, object: &Object, [x, y, _]: [f32; 3], frame: &DepthImage) -> Result<Vec<f32>> {
        let cloud = self.eye.cloud(frame);
        ensure!(
            cloud.len() == CLOUD,
            "the camera does not see {} at x {x}, y {y}: is it too small?",
            object.name
        );
        Ok(cloud.iter().flat_map(|p| p.to_array()).collect())
    }
}
