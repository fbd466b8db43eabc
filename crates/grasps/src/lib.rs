//! Grasp search: candidates around an object, kinematic closing, contact-force balance, physics trial,
//! clustering.
//!
//! In: an object. Out: grasps that lift it, and demonstrations of them (paper §II-A). Independent of the
//! networks.

pub mod candidates;
pub mod catalog;
pub mod closing;
pub mod clusters;
pub mod contact_forces;
pub mod demonstration;
pub mod grasp;
pub mod grasp_set;
pub mod import;
pub mod k_medoids;
pub mod lift;
pub mod object_poses;
pub mod reachability;
pub mod robustness;
pub mod search;
pub mod selection;
pub mod symmetry;
pub mod transfer;
pub mod trial;

pub use grasp::{Grasp, Posture};
pub use grasp_set::GraspSet;
pub use reachability::{GraspBranch, PlacedObject, RobotContext};
