//! Robot model: a KUKA LBR iiwa 7 arm with an Allegro right hand, 23 joints in total.
//!
//! The numbers of joints and fingers are constants. All other values of arm and hand are in the files of
//! `assets/robot/iiwa7_allegro`, which [`KinematicTree::load`] combines.
//!
//! In: joint positions, velocities and accelerations. Out: poses, Jacobians, and the next joint state.
//! Independent of physics, tasks and networks.
//!
//! - [`tree`]: bodies, joints and frames, from the robot's description file (URDF)
//! - [`kinematics`]: forward kinematics and Jacobians
//! - [`ik`]: inverse kinematics of the palm, which is the end effector
//! - [`limits`], [`integrator`], [`spline`]: joint limits, one time step, motions between two postures
//! - [`collision_shapes`], [`collision_spheres`]: convex shapes for physics, spheres for the motion planner
//!
//! Joint space is double precision ([`JointVector`]). Joints and bodies are counted from 0: joint 0 rotates the
//! whole arm about the vertical axis, and body 0 is the fixed base.
//!
//! The robot's base frame is the world frame: x forward over the table, y to the left, z up, in metres. Palm
//! frame: x along the palm normal, y towards the index finger, z along the fingers.

pub mod collision_shapes;
pub mod collision_spheres;
mod description;
pub mod hand_model;
pub mod ik;
pub mod integrator;
pub mod kinematics;
pub mod limits;
pub mod rotation;
pub mod spline;
pub mod tree;
mod urdf;
mod xml_element;

pub use description::RobotDescription;
pub use hand_model::HandModel;
pub use kinematics::Kinematics;
pub use limits::JointLimits;
pub use tree::KinematicTree;
pub use urdf::UrdfError;

/// Number of arm joints. They come first in every joint vector.
pub const ARM_DOF: usize = 7;
/// Number of hand joints: four each for index, middle, ring and thumb.
pub const HAND_DOF: usize = 16;
/// Number of joints (degrees of freedom) of arm and hand.
pub const DOF: usize = ARM_DOF + HAND_DOF;
/// Number of fingers, including the thumb, which comes last.
pub const NUM_FINGERS: usize = 4;
/// Number of joints of a finger.
pub const FINGER_DOF: usize = HAND_DOF / NUM_FINGERS;

/// A vector with one value per joint, arm joints first: rad, rad/s or rad/s², as stated at each use.
pub type JointVector = nalgebra::SVector<f64, DOF>;
/// A metric (inertia of joint motions) or another bilinear form on joint space, shape (DOF, DOF).
pub type JointMatrix = nalgebra::SMatrix<f64, DOF, DOF>;
/// A rigid transform (m) in double precision; `world_from_palm` maps palm coordinates to world coordinates.
pub type Isometry = nalgebra::Isometry3<f64>;
/// A vector or point in double precision (m).
pub type Vector = nalgebra::Vector3<f64>;

/// Position and velocity of all joints.
///
/// ```rust
/// use robot::{ARM_DOF, JointState, JointVector};
/// let mut state = JointState::at_rest(JointVector::zeros());
/// // The arm joints come first, then the joints of the index finger.
/// state.q[ARM_DOF] = 0.2; // rad
/// assert_eq!(robot::hand_joints(&state.q)[0], 0.2);
/// assert_eq!(state.qd, JointVector::zeros()); // rad/s
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState {
    /// Joint positions q (rad).
    pub q: JointVector,
    /// Joint velocities q̇ (rad/s).
    pub qd: JointVector,
}

impl JointState {
    /// State at position `q` (rad) with zero velocity.
    pub fn at_rest(q: JointVector) -> Self {
        Self { q, qd: JointVector::zeros() }
    }
}

/// Concatenates 7 arm values and 16 hand values to a joint vector.
pub fn joint_vector(arm: &[f64; ARM_DOF], hand: &[f64; HAND_DOF]) -> JointVector {
    JointVector::from_fn(|i, _| if i < ARM_DOF { arm[i] } else { hand[i - ARM_DOF] })
}

/// Whether a hand joint (0 to 15) flexes its finger. The first joint of a finger moves it sideways; that of the
/// thumb rotates the thumb to oppose the fingers.
pub fn is_flexion_joint(hand_joint: usize) -> bool {
    !hand_joint.is_multiple_of(FINGER_DOF)
}

/// Extracts the 16 hand joints of a joint vector.
pub fn hand_joints(q: &JointVector) -> [f64; HAND_DOF] {
    std::array::from_fn(|i| q[ARM_DOF + i])
}

/// Extracts the 7 arm joints of a joint vector.
pub fn arm_joints(q: &JointVector) -> [f64; ARM_DOF] {
    std::array::from_fn(|i| q[i])
}
