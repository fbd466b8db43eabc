//! Training data: demonstration groups, their split, and the states that the policy visits.

pub mod demo_group;
pub mod grasp_points;
pub(crate) mod nearest_neighbor;
pub(crate) mod rollout_buffer;
pub mod split;
