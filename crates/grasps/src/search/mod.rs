//! Search for grasps: candidates, kinematic closing, balance of contact forces, trials in physics.

pub mod candidates;
pub mod closing;
mod config;
pub mod contact_forces;
mod grasp_search;
mod palm_transfer;
mod parallel;
pub mod robustness;
pub mod transfer;
pub mod trial;

pub use config::SearchConfig;
pub(crate) use grasp_search::Search;
pub use grasp_search::{STAGE, refine_around, search, try_imported};
