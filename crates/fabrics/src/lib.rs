//! Geometric fabrics as a motion planner: (q, q̇) -> q̈ towards a goal, around obstacles.
//!
//! After Van Wyk et al., "Geometric fabrics: generalizing classical mechanics to capture the physics
//! of behavior" (RA-L 2022), and Ratliff et al., "Generalized nonlinear and Finsler geometry for
//! robotics" (ICRA 2021). The parameters are our own. Independent of physics and networks.

pub mod energy;
pub mod fabric;
pub mod joint_limits;
pub mod planner;
pub mod spec;
pub mod terms;

pub use fabric::{Fabric, FabricConfig, Goal};
pub use planner::{Plan, PlannerConfig};
pub use spec::Spec;
