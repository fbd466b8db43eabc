//! Interface of a simulated world for grasp trials and attempts.

use geometry::{Pose, Vec3};
use robot::JointState;

/// A world with a commanded hand and an object.
pub trait Simulation {
    /// Steps physics for one control period. The joint targets follow the cubic from `from` to `to`, which is
    /// exact for the constant acceleration of Eq. 6-7.
    fn track(&mut self, from: &JointState, to: &JointState);

    /// Pose of the palm body.
    fn palm_pose(&self) -> Pose;

    /// Pose of the object.
    fn object_pose(&self) -> Pose;

    /// Extents (m) of the object's bounding box, object frame.
    fn object_size(&self) -> Vec3;

    /// Height (m) of the lowest point of the object above the table top.
    fn object_height(&self) -> f32;

    /// Current contacts of the object.
    fn contact_state(&self) -> ContactState;

    /// Whether all poses are finite and rapier has quarantined no body.
    fn is_finite(&self) -> bool;
}

/// A contact force on the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactForce {
    /// Point of application (m).
    pub point: Vec3,
    /// Force (N), including friction.
    pub force: Vec3,
}

/// Bodies in contact with the object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactState {
    /// Contact with the table.
    pub table: bool,
    /// Contact with a finger or the palm.
    pub hand: bool,
    /// Contact with an arm link.
    pub arm: bool,
}
