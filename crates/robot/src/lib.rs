//! The 23 joints: a KUKA LBR iiwa 7 arm with an Allegro right hand.
//!
//! Joint space is double precision (`JointVector`, rad); positions are metres in the robot's base
//! frame, which is the world. Knows nothing of physics, tasks or networks.

pub mod ik;
pub mod integrator;
pub mod kinematics;
pub mod limits;
pub mod rotation;
pub mod solids;
pub mod spheres;
pub mod spline;
pub mod tree;
mod urdf;

pub use kinematics::Kinematics;
pub use limits::Limits;
pub use tree::Tree;
pub use urdf::UrdfError;

/// Joints of the arm; they come first in every joint vector.
pub const ARM: usize = 7;
/// Joints of the hand: index, middle, ring, thumb, four each.
pub const HAND: usize = 16;
/// All joints.
pub const DOF: usize = ARM + HAND;
/// Fingers, the thumb last.
pub const FINGERS: usize = 4;

/// One value per joint.
pub type JointVector = nalgebra::SVector<f64, DOF>;
/// A metric or other bilinear form over joints, shape (DOF, DOF).
pub type JointMatrix = nalgebra::SMatrix<f64, DOF, DOF>;
/// A rigid transform in double precision; `world_from_palm` maps palm coordinates to the world.
pub type Isometry = nalgebra::Isometry3<f64>;
/// A vector or point in double precision (m).
pub type Vector = nalgebra::Vector3<f64>;

/// Position and velocity of all joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState {
    /// q (rad).
    pub q: JointVector,
    /// q̇ (rad/s).
    pub qd: JointVector,
}

impl JointState {
    /// At rest in `q`.
    pub fn at_rest(q: JointVector) -> Self {
        Self { q, qd: JointVector::zeros() }
    }
}

/// Joins seven arm values and sixteen hand values to one joint vector.
pub fn join(arm: &[f64; ARM], hand: &[f64; HAND]) -> JointVector {
    JointVector::from_fn(|i, _| if i < ARM { arm[i] } else { hand[i - ARM] })
}

/// The hand's share of a joint vector.
pub fn hand_of(q: &JointVector) -> [f64; HAND] {
    std::array::from_fn(|i| q[ARM + i])
}

/// The arm's share of a joint vector.
pub fn arm_of(q: &JointVector) -> [f64; ARM] {
    std::array::from_fn(|i| q[i])
}
