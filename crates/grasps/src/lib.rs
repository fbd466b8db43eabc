//! Grasps found by search: proposals around an object, kinematic closing, a wrench test, a trial in physics.
//!
//! In: an object. Out: grasps that lift it (paper §II-A). Knows nothing of networks.

pub mod built_in;
pub mod choice;
pub mod closing;
pub mod cluster;
pub mod demonstration;
pub mod grasp;
pub mod grasp_set;
pub mod import;
pub mod kind;
pub mod lift;
pub mod place;
pub mod proposal;
pub mod reach;
pub mod search;
pub mod sides;
pub mod squeeze;
pub mod tolerance;
pub mod transfer;
pub mod trial;

pub use grasp::{Grasp, Posture};
pub use grasp_set::GraspSet;
pub use reach::{Robot, Setting, Way};
