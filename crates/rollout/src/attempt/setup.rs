//! Initial conditions of an attempt. Object pose, sensor noise and start target are sampled from its seed,
//! in this order.

use crate::rollout_context::{RolloutContext, RolloutError};
use geometry::{Pose, Vec3};
use grasps::RobotContext;
use grasps::plan::{demonstration, object_poses};
use objects::object::Object;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::Isometry;

/// Max absolute value of the object's coordinates (m) and yaw (rad).
const MAX_COORDINATE: f32 = 100.0;

/// The object, its pose, and its point cloud before the first step.
pub(crate) struct AttemptSetup {
    pub(crate) object: Object,
    pub(crate) object_name: String,
    /// Pose of the object: x, y (m), yaw (rad).
    pub(crate) pose: [f32; 3],
    /// The same pose, world frame.
    pub(crate) world_from_object: Pose,
    /// Seed of all random samples of the attempt.
    pub(crate) seed: u64,
    /// Captured point cloud (m), base frame.
    pub(crate) cloud: Vec<Vec3>,
}

/// Samples the object pose of a seed: x, y (m), yaw (rad), world frame.
pub fn sample_object_pose(robot: &RobotContext, seed: u64) -> [f32; 3] {
    sample_pose_with_rng(robot, seed).0
}

/// Samples the object pose and returns the generator for all further samples of the attempt.
pub(crate) fn sample_pose_with_rng(robot: &RobotContext, seed: u64) -> ([f32; 3], ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (object_poses::sample_planar_pose(robot, &mut rng), rng)
}

impl AttemptSetup {
    /// Samples the object pose (unless given) and captures a cloud. Also returns the generator for the start
    /// target and all further samples.
    pub(crate) fn sample(
        context: &RolloutContext,
        object: &Object,
        object_name: &str,
        pose: Option<[f32; 3]>,
        seed: u64,
    ) -> Result<(Self, ChaCha8Rng), RolloutError> {
        let (sampled, mut rng) = sample_pose_with_rng(&context.robot, seed);
        let pose = pose.unwrap_or(sampled);
        if !pose.iter().all(|number| number.abs() < MAX_COORDINATE) {
            return Err(RolloutError::OffTheTable);
        }
        let world_from_object = context.robot.config.object_pose(pose[0], pose[1], pose[2]);
        let cloud = capture_cloud(context, object, &world_from_object, &mut rng);
        let object = object.clone();
        let object_name = object_name.to_owned();
        Ok((Self { object, object_name, pose, world_from_object, seed, cloud }, rng))
    }
}

/// Samples the desired palm pose of the start configuration, world frame, from the true pose of the object.
pub(crate) fn sample_start_target(
    robot: &RobotContext,
    object: &Object,
    world_from_object: &Pose,
    rng: &mut ChaCha8Rng,
) -> Isometry {
    let nominal = robot.nominal_facing(world_from_object);
    let nominal_palm = robot.tree.forward_kinematics(&nominal).palm_pose();
    let bounds = &object.bounds;
    demonstration::sample_pregrasp_pose(robot, bounds, world_from_object, &nominal_palm, rng)
}

/// Captures one noisy depth image and extracts its point cloud.
pub(crate) fn capture_cloud(
    context: &RolloutContext,
    object: &Object,
    world_from_object: &Pose,
    rng: &mut ChaCha8Rng,
) -> Vec<Vec3> {
    let frame = context.sensor.capture(&object.mesh, world_from_object, rng);
    context.sensor.extract_cloud(&frame)
}
