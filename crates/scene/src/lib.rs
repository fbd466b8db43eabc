//! Simulated world: table, object, arm and hand (or the hand alone), and the depth camera.
//!
//! In: joint targets. Out: poses, contacts, point clouds. Independent of policies and planners. Physics types
//! are private.

mod colliders;
pub mod config;
mod convex_dispatcher;
pub mod depth_camera;
pub mod depth_noise;
pub mod depth_sensor;
mod floating_hand;
pub mod hold_monitor;
mod links;
mod rest_test;
mod scene;
mod scene_hash;
mod simulation;
mod tabletop;

pub use config::{SceneConfig, SceneError};
pub use floating_hand::FloatingHandScene;
pub use hold_monitor::{HoldFailure, HoldMonitor};
pub use rest_test::rests_on_table;
pub use scene::{DragSpring, Scene};
pub use scene_hash::{hash_values, scene_hash};
pub use simulation::{ContactForce, ContactState, Simulation};
