//! A grasp: where the palm is on the object, and two postures of the hand.

use geometry::object::Object;
use geometry::solid::Solid;
use geometry::{Pose, Vec3};
use robot::{HAND, Isometry, JointVector, Tree, ik, rotation};

/// A grasp in the object's frame.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Grasp {
    /// The kinds of a set are tried in this order; a grasp and its half turn are of one kind.
    pub kind: usize,
    /// Pose of the palm in the object.
    pub object_from_palm: Isometry,
    /// Hand joints (rad) before closing.
    pub open: [f64; HAND],
    /// Hand joints (rad) at first contact.
    pub touch: [f64; HAND],
    /// Commanded hand joints (rad) that press: beyond the surface.
    pub squeeze: [f64; HAND],
}

/// A grasp on an object that stands somewhere: joint positions of the whole robot.
#[derive(Clone, Copy, Debug)]
pub struct Posture {
    /// Palm in place, hand open.
    pub open: JointVector,
    /// Fingers at first contact.
    pub touch: JointVector,
    /// Commanded to press.
    pub squeeze: JointVector,
}

impl Grasp {
    /// Arm joints for the grasp on an object at `world_from_object`, solved from `nominal`.
    pub fn posture(
        &self,
        tree: &Tree,
        world_from_object: &Pose,
        nominal: &JointVector,
        config: &ik::IkConfig,
    ) -> Option<Posture> {
        let palm = rotation::to_isometry(world_from_object) * self.object_from_palm;
        let arm = robot::arm_of(&ik::solve(tree, &palm, nominal, config)?);
        Some(Posture {
            open: robot::join(&arm, &self.open),
            touch: robot::join(&arm, &self.touch),
            squeeze: robot::join(&arm, &self.squeeze),
        })
    }
}

/// The object's collision parts in the world.
pub fn object_solids(object: &Object, world_from_object: &Pose) -> Vec<Solid> {
    let hulls = object.parts.iter().filter_map(|points| Solid::hull(points));
    hulls.map(|solid| solid.moved(world_from_object)).collect()
}

/// The table as the scene has it.
pub fn table_solid(config: &scene::SceneConfig) -> Solid {
    let solid = Solid::cuboid(Vec3::from_array(config.table.half));
    solid.moved(&Pose::from_translation(Vec3::from_array(config.table.center)))
}
