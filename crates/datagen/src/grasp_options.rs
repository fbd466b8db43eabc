//! Reachable grasps of an object pose, in coordinates that compare grasps of different objects.

use anyhow::{Context, Result, ensure};
use files::tensors::{self, read_f32};
use grasps::search::grasp_rating::GraspRating;
#[cfg(doc)]
use grasps::search::grasp_rating::LOWERINGS;
use grasps::{Grasp, GraspBranch, PlacedObject};
use objects::shape_moments::{NUM_MOMENTS, moments};
use robot::{JointVector, NUM_FINGERS, Vector, rotation};
use safetensors::SafeTensors;

/// Points of the robot that describe a grasp: palm, point that the hand grasps, fingertips, elbow.
const NUM_POINTS: usize = 3 + NUM_FINGERS;
/// Body whose origin is the elbow. Its weight is smaller: it decides between solutions of inverse kinematics.
const ELBOW_BODY: usize = 4;
const ELBOW_WEIGHT: f64 = 0.3;

/// Positions (m) of [`NUM_POINTS`] points of the robot relative to the object, in the vertical plane through
/// robot and object (x away from the robot, z up).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RobotPoints(pub(crate) [[f32; 3]; NUM_POINTS]);

impl RobotPoints {
    /// Mean distance (m) of the points.
    pub(crate) fn distance(&self, other: &Self) -> f32 {
        let squared = |(a, b): (&[f32; 3], &[f32; 3])| -> f32 {
            a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
        };
        self.0.iter().zip(&other.0).map(|pair| squared(pair).sqrt()).sum::<f32>()
            / NUM_POINTS as f32
    }

    /// Weighted mean.
    pub(crate) fn mean<'a>(weighted: impl Iterator<Item = (f32, &'a Self)>) -> Self {
        let (mut sum, mut total) = ([[0.0; 3]; NUM_POINTS], 0.0);
        for (weight, points) in weighted {
            total += weight;
            for (sum, x) in sum.iter_mut().flatten().zip(points.0.iter().flatten()) {
                *sum += weight * x;
            }
        }
        sum.iter_mut().flatten().for_each(|sum| *sum /= total);
        Self(sum)
    }

    /// The points of a robot at `q` (rad) that grasps an object.
    fn of(placed: &PlacedObject, q: &JointVector) -> Self {
        let robot = placed.robot;
        let kinematics = robot.tree.forward_kinematics(q);
        let palm = kinematics.palm_pose();
        let center = palm.transform_point(&robot.tree.hand.grasp.center.into()).coords;
        let object = rotation::to_vector(placed.world_from_object.translation);
        let azimuth = libm::atan2(object.y, object.x);
        let turn = rotation::from_axis_angle(&Vector::z(), -azimuth);
        let elbow = kinematics.world_from_body[ELBOW_BODY].translation.vector - object;
        let mut points = [[0.0; 3]; NUM_POINTS];
        let hand = [palm.translation.vector, center].into_iter().chain(kinematics.fingertips());
        let relative = hand.map(|point| point - object).chain([ELBOW_WEIGHT * elbow]);
        for (point, relative) in points.iter_mut().zip(relative) {
            *point = (turn * relative).map(|x| x as f32).into();
        }
        Self(points)
    }
}

/// A reachable grasp at an object pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GraspOption {
    pub(crate) branch: GraspBranch,
    /// Success rate under hand pose error.
    pub(crate) success_rate: f32,
    pub(crate) points: RobotPoints,
}

/// Size, shape and orientation of an object (m) in the vertical plane through robot and object, and its
/// distance from the robot. Nearly equal for poses with similar point clouds.
pub(crate) type Descriptor = [f32; NUM_MOMENTS];

/// Weight of the object's position in a [`Descriptor`], relative to lengths of its shape.
const POSITION_WEIGHT: f32 = 0.3;

/// The descriptor of an object with these surface points (object frame) at x, y (m), yaw (rad).
pub(crate) fn describe(surface: &[geometry::Vec3], [x, y, yaw]: [f32; 3]) -> Descriptor {
    let canonical = [libm::hypotf(x, y), 0.0, yaw - libm::atan2f(y, x)];
    let moments = moments(surface, canonical);
    // Second and third moments become lengths.
    let variance = (moments[3] + moments[6] + moments[8]).max(1e-6);
    let scale = |i: usize| match i {
        0 | 1 => POSITION_WEIGHT,
        2 => 1.0,
        3..9 => 1.0 / libm::sqrtf(variance),
        _ => 1.0 / variance,
    };
    std::array::from_fn(|i| scale(i) * moments[i])
}

/// Reachable grasps of an object pose.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PoseOptions {
    pub(crate) descriptor: Descriptor,
    /// In order of the grasps.
    pub(crate) options: Vec<GraspOption>,
}

impl PoseOptions {
    /// All grasps that the robot can reach, each with its first solution of inverse kinematics. `placed`: the object,
    /// once per height of the table ([`LOWERINGS`]); `ratings`: one per grasp.
    pub(crate) fn find(
        placed: &[PlacedObject],
        grasps: &[Grasp],
        ratings: &[GraspRating],
        descriptor: Descriptor,
    ) -> Self {
        let option = |grasp: usize| {
            let GraspRating { success_rate, lowering } = ratings[grasp];
            let placed = &placed[lowering];
            let (branch, posture) = placed.plan_grasp(grasp, grasps)?;
            let points = RobotPoints::of(placed, &posture.grasp);
            Some(GraspOption { branch, success_rate, points })
        };
        Self { descriptor, options: (0..grasps.len()).filter_map(option).collect() }
    }

    /// Encodes the options of several poses.
    pub(crate) fn encode(all: &[Self]) -> Result<Vec<u8>> {
        let descriptors: Vec<f32> = all.iter().flat_map(|pose| pose.descriptor).collect();
        let counts: Vec<f32> = all.iter().map(|pose| pose.options.len() as f32).collect();
        let options: Vec<&GraspOption> = all.iter().flat_map(|pose| &pose.options).collect();
        let branches: Vec<f32> = options
            .iter()
            .flat_map(|option| [option.branch.ik_seed as f32, option.branch.grasp as f32])
            .collect();
        let rates: Vec<f32> = options.iter().map(|option| option.success_rate).collect();
        let points: Vec<f32> =
            options.iter().flat_map(|option| option.points.0.into_iter().flatten()).collect();
        let (poses, count) = (all.len(), options.len());
        tensors::encode(
            &[
                ("descriptors", vec![poses, NUM_MOMENTS], &descriptors),
                ("counts", vec![poses], &counts),
                ("branches", vec![count, 2], &branches),
                ("success_rates", vec![count], &rates),
                ("points", vec![count, NUM_POINTS, 3], &points),
            ],
            None,
        )
    }

    /// Inverse of [`PoseOptions::encode`].
    pub(crate) fn decode(bytes: &[u8]) -> Result<Vec<Self>> {
        let tensors = SafeTensors::deserialize(bytes)?;
        let read = |name: &str| read_f32(&tensors, name);
        let (descriptors, counts) = (read("descriptors")?, read("counts")?);
        let (branches, points) = (read("branches")?, read("points")?);
        let rates = read("success_rates")?;
        let pairs = branches.chunks_exact(2).zip(points.chunks_exact(3 * NUM_POINTS));
        let mut options = pairs.zip(&rates).map(|((branch, x), &success_rate)| {
            let branch = GraspBranch { ik_seed: branch[0] as usize, grasp: branch[1] as usize };
            let point = |k: usize| std::array::from_fn(|axis| x[3 * k + axis]);
            let points = RobotPoints(std::array::from_fn(point));
            GraspOption { branch, success_rate, points }
        });
        let total: f32 = counts.iter().sum();
        ensure!(total as usize == options.len(), "the counts do not match");
        let pose = |(descriptor, count): (&[f32], &f32)| {
            let descriptor = descriptor.try_into().context("the descriptors have another size")?;
            Ok(Self { descriptor, options: options.by_ref().take(*count as usize).collect() })
        };
        descriptors.chunks_exact(NUM_MOMENTS).zip(&counts).map(pose).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dataset::planar_pose::rotate_pose;
    use grasps::RobotContext;
    use objects::Object;

    /// Options of the sugar box at a pose.
    fn options(robot: &RobotContext, pose: [f32; 3]) -> PoseOptions {
        let object = Object::from_catalog("sugar_box").unwrap();
        let grasps = grasps::set::catalog::catalog_grasps("sugar_box").unwrap().grasps;
        let world_from_object = robot.config.object_pose(pose[0], pose[1], pose[2]);
        let placed = PlacedObject::new(robot, &object, &world_from_object);
        let surface = geometry::surface_sampling::sample_surface(&object.mesh, 4096);
        let ratings: Vec<GraspRating> = (0..grasps.len())
            .map(|i| GraspRating { success_rate: 0.1 * i as f32, lowering: 0 })
            .collect();
        PoseOptions::find(&[placed], &grasps, &ratings, describe(&surface, pose))
    }

    #[test]
    fn options_do_not_depend_on_the_azimuth() {
        let robot = RobotContext::standard().unwrap();
        let pose = [0.6, 0.05, 0.4];
        let [a, b] = [pose, rotate_pose(pose, 0.3)].map(|pose| options(&robot, pose));
        assert!(a.options.len() > 1 && a.options.len() == b.options.len());
        for (a, b) in a.options.iter().zip(&b.options) {
            assert_eq!(a.branch, b.branch);
            assert!(a.points.distance(&b.points) < 1e-4, "{}", a.points.distance(&b.points));
        }
        let difference = |(a, b): (&f32, &f32)| (a - b).abs();
        let error = a.descriptor.iter().zip(&b.descriptor).map(difference).fold(0.0, f32::max);
        assert!(error < 1e-4, "{error}");
        let bytes = PoseOptions::encode(std::slice::from_ref(&a)).unwrap();
        assert_eq!(PoseOptions::decode(&bytes).unwrap(), [a]);
    }

    #[test]
    fn descriptor_is_in_metres_and_resolves_yaw() {
        let object = Object::from_catalog("sugar_box").unwrap();
        let surface = geometry::surface_sampling::sample_surface(&object.mesh, 4096);
        let [a, b] = [0.0, 0.5].map(|yaw| describe(&surface, [0.6, 0.0, yaw]));
        assert!((a[0] - 0.18).abs() < 1e-3 && (a[2] - 0.088).abs() < 2e-3, "{a:?}");
        let apart = a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt();
        assert!((0.003..0.03).contains(&apart), "{apart} m");
    }
}
