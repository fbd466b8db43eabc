//! Grasp search: candidates around an object, kinematic closing, contact-force balance, physics trial,
//! clustering.
//!
//! In: an object. Out: grasps that lift it, and demonstrations of them (paper §II-A). Independent of the
//! networks.

pub mod plan;
pub mod search;
pub mod set;

pub use plan::reachability::{GraspBranch, PlacedObject, RobotContext};
pub use set::grasp::{Grasp, Posture};
pub use set::grasp_set::GraspSet;
