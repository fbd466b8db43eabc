//! A grasp: the pose of the palm relative to the object, and three postures of the hand.

use geometry::convex_shape::ConvexShape;
use geometry::{Pose, Vec3};
use objects::object::Object;
use robot::{HAND_DOF, Isometry, JointVector, KinematicTree, ik, rotation};

/// A grasp in the object's frame.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Grasp {
    /// Cluster index: clusters are tried in this order. A grasp and its half-turn counterpart share one
    /// cluster.
    pub cluster: usize,
    /// Pose of the palm in the object's frame.
    pub object_from_palm: Isometry,
    /// Hand joints (rad) before closing.
    pub pregrasp: [f64; HAND_DOF],
    /// Hand joints (rad) at first contact.
    pub grasp: [f64; HAND_DOF],
    /// Commanded hand joints (rad) beyond the surface, so that the compliant motors press.
    pub squeeze: [f64; HAND_DOF],
}

/// A grasp on a placed object: joint positions (rad) of the whole robot.
#[derive(Clone, Copy, Debug)]
pub struct Posture {
    /// Palm at the grasp pose, hand in the pregrasp posture.
    pub pregrasp: JointVector,
    /// Palm at the grasp pose, fingers at first contact.
    pub grasp: JointVector,
    /// Palm at the grasp pose, fingers commanded to press.
    pub squeeze: JointVector,
}

impl Grasp {
    /// The grasp as bytes, for a worker that shares no memory.
    pub fn to_bytes(&self) -> Vec<u8> {
        // Only sequences of unknown length fail.
        postcard::to_allocvec(self).unwrap_or_default()
    }

    /// Inverse of [`Grasp::to_bytes`].
    ///
    /// # Errors
    /// The bytes are not a grasp of this version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        postcard::from_bytes(bytes)
    }

    /// Solves inverse kinematics from `nominal` for the grasp on an object at `world_from_object`.
    pub fn posture(
        &self,
        tree: &KinematicTree,
        world_from_object: &Pose,
        nominal: &JointVector,
        config: &ik::IkConfig,
    ) -> Option<Posture> {
        let palm = rotation::to_isometry(world_from_object) * self.object_from_palm;
        let arm = robot::arm_joints(&ik::solve(tree, &palm, nominal, config)?);
        Some(Posture {
            pregrasp: robot::joint_vector(&arm, &self.pregrasp),
            grasp: robot::joint_vector(&arm, &self.grasp),
            squeeze: robot::joint_vector(&arm, &self.squeeze),
        })
    }
}

/// The object's convex parts in the world frame.
pub fn object_shapes(object: &Object, world_from_object: &Pose) -> Vec<ConvexShape> {
    let hulls = object.parts.iter().filter_map(|points| ConvexShape::hull(points));
    hulls.map(|solid| solid.transformed(world_from_object)).collect()
}

/// The table of the scene as a box in the world frame.
pub fn table_shape(config: &scene::SceneConfig) -> ConvexShape {
    let solid = ConvexShape::cuboid(Vec3::from_array(config.table.half_extents));
    solid.transformed(&Pose::from_translation(Vec3::from_array(config.table.center)))
}
