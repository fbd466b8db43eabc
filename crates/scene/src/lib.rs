//! The simulated world: table, object, arm and hand (or the hand alone), and the depth camera that looks at them.
//!
//! In: joint targets. Out: poses, contacts, point clouds. Knows nothing of policies or planners;
//! physics types stay inside.

pub mod camera;
pub mod cloud;
mod colliders;
pub mod config;
mod hand;
pub mod hold;
mod links;
pub mod noise;
mod simulation;
mod tabletop;
mod world;

pub use config::{SceneConfig, SceneError};
pub use hand::HandScene;
pub use hold::{Hold, Loss};
pub use simulation::{Contact, Simulation, Touching};
pub use world::{Pull, Scene};
