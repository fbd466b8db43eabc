//! Tests across crates, in one program: linking candle and rapier once keeps the cycle short.

#![allow(clippy::unwrap_used, reason = "test helpers fail by panicking")]

mod candle_parity;
mod consistent_grasps;
mod controls;
mod demonstration_quality;
mod demonstration_replay;
mod goldens;
mod grasp_search;
mod grasp_trials;
mod held_box;
mod interaction;
mod parity;
mod pipeline;
mod recording;
