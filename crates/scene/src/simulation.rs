//! What a trial and a verdict need of a simulated world.

use geometry::{Pose, Vec3};
use robot::JointState;

/// A world in which a hand is driven and an object may be held.
pub trait Simulation {
    /// Steps physics for one control period while the joints are commanded along the cubic that
    /// joins `from` to `to`; exact for the constant acceleration of Eq. 6-7.
    fn follow(&mut self, from: &JointState, to: &JointState);

    /// Pose of the body that carries the palm.
    fn palm_pose(&self) -> Pose;

    /// Pose of the object.
    fn object_pose(&self) -> Pose;

    /// Extent (m) of the object's bounding box in its own frame.
    fn object_size(&self) -> Vec3;

    /// Height (m) of the object's lowest point over the table's top.
    fn object_height(&self) -> f32;

    /// What the object touches now.
    fn touching(&self) -> Touching;

    /// Whether every pose is a finite number and the engine has given up on no body.
    fn is_finite(&self) -> bool;
}

/// Something presses on an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Where (m).
    pub point: Vec3,
    /// With what force (N), friction included.
    pub force: Vec3,
}

/// What an object touches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Touching {
    /// The table.
    pub table: bool,
    /// A finger or the palm.
    pub hand: bool,
    /// An arm link.
    pub arm: bool,
}
