//! Simulated world: table, object, arm and hand, and the depth camera.
//!
//! In: joint targets. Out: poses, contacts, point clouds. Independent of policies and planners. Physics types
//! are private.

mod colliders;
pub mod config;
mod contacts;
mod convex_dispatcher;
pub mod depth_camera;
pub mod depth_noise;
pub mod depth_sensor;
pub mod hold_monitor;
mod links;
mod rest_test;
mod scene;
mod scene_hash;
mod tabletop;

pub use config::{SceneConfig, SceneError};
pub use contacts::{ContactForce, ContactState};
pub use hold_monitor::{HoldFailure, HoldMonitor};
pub use rest_test::rests_on_table;
pub use scene::{DragSpring, Scene};
pub use scene_hash::{hash_values, scene_hash};
