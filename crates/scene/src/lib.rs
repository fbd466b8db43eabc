//! The simulated world: table, object, arm and hand, and the depth camera that looks at them.
//!
//! In: joint targets. Out: poses, contacts, point clouds. Knows nothing of policies or planners;
//! physics types stay inside.

pub mod camera;
pub mod cloud;
mod colliders;
pub mod config;
pub mod hold;
pub mod noise;
mod world;

pub use config::{SceneConfig, SceneError};
pub use hold::{Hold, Loss};
pub use world::{Scene, Touching};
