//! Arm motions of a grasp: reachability, lift, demonstrations out of the grasp.

pub mod demonstration;
pub mod lift;
pub mod object_poses;
pub mod reachability;
mod retreat;
