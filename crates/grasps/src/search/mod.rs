//! Search for grasps: candidates, kinematic closing, balance of contact forces, trials in physics.

mod candidate_pool;
pub mod candidates;
pub mod closing;
mod config;
pub mod contact_forces;
pub mod grasp_rating;
mod grasp_search;
pub mod nearby_grasp;
mod palm_transfer;
pub(crate) mod parallel;
mod pinch;
pub mod robustness;
mod run;
mod task;
mod tested_candidate;
mod tester;
pub mod transfer;
pub mod trial;

pub use config::SearchConfig;
pub use grasp_search::{GraspSearch, SearchCounts};
pub use pinch::PinchPlan;
pub use run::{STAGE, refine_around, search, try_imported};
pub use task::{ClosedCandidate, Region, Task, TaskResult, TrialResult};
pub use tester::{GraspTester, Trial};
