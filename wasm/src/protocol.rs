//! Messages between the page and its worker. `web/src/demo/worker/protocol.ts` is generated from them.
//!
//! Metres, radians, kilograms, seconds; z is up; quaternions are x, y, z, w.

mod event;
mod request;
mod telemetry;
#[cfg(all(test, not(target_arch = "wasm32")))]
mod typescript;

pub(crate) use event::{
    AttemptFinished, BatchAttempt, BuiltIn, Cloud, DepthCamera, Event, Failure, Frame, GraspsFound,
    Joint, Link, Model, ObjectInfo, ObjectLoaded, Outcome, Phase, PlaybackInfo, Progress,
    ProgressUnit, Ready, Rectangle, SavedFile, SearchBatch, Shape, Table,
};
pub(crate) use request::Request;
pub(crate) use telemetry::TelemetrySample;

use serde::{Deserialize, Serialize};

/// Spring force of the user on the object: attachment point (object frame) and target (world frame).
#[derive(Clone, Copy, Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct Drag {
    pub(crate) point: [f32; 3],
    pub(crate) target: [f32; 3],
}

/// Pose of the object on the table.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct PlanarPose {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) yaw: f32,
}
