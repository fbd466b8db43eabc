//! The commands of `ngf-worker` as processes.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

mod bad_meshes;
mod compare;
mod dataset;
mod evaluate;
mod mesh_options;
mod pipes;
mod train;
