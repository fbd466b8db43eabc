//! Requests of the page.

use super::{Drag, PlanarPose};
use mesh::{Unit, UpAxis};
use objects::import::Orientation;
use serde::Deserialize;

/// Request of the page.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "WorkerRequest"))]
#[serde(tag = "kind", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(crate) enum Request {
    LoadObject {
        object: String,
    },
    /// A mesh, or a demonstration or a recorded attempt (JSON).
    Upload {
        file_name: String,
        #[serde(with = "serde_bytes")]
        #[cfg_attr(test, ts(type = "ArrayBuffer"))]
        bytes: Vec<u8>,
        #[cfg_attr(test, ts(type = "Unit | null"))]
        unit: Option<Unit>,
        /// Length (m) of the longest side, instead of unit and scale.
        size_m: Option<f32>,
        /// Factor on the coordinates, in addition to the unit.
        scale: Option<f32>,
        /// Axis of the file that points up.
        #[cfg_attr(test, ts(type = "UpAxis | null"))]
        up: Option<UpAxis>,
        mass_kg: Option<f32>,
        #[cfg_attr(test, ts(type = "Orientation | null"))]
        orientation: Option<Orientation>,
    },
    /// Loads this model. `only_if_idle` drops it if an attempt is running when the download completes; `base` is
    /// the URL of the page.
    LoadModel {
        id: String,
        base: String,
        only_if_idle: bool,
    },
    Place {
        pose: PlanarPose,
    },
    /// Places the object at the pose that an attempt with this seed samples.
    PlaceBySeed {
        seed: u32,
    },
    Grasp {
        seed: u32,
    },
    Pause,
    Resume,
    Step,
    Reset,
    Speed {
        factor: f64,
    },
    /// Shows the state after this tick; resuming plays from there.
    Seek {
        tick: usize,
    },
    /// Adds telemetry to each frame. Turning it on also posts the samples of the attempt so far.
    StreamTelemetry {
        on: bool,
    },
    /// Runs attempts of consecutive seeds, starting with `seed`, at full speed.
    Batch {
        seed: u32,
        attempts: u32,
        /// Batch id, part of the resulting events.
        batch_id: u32,
    },
    /// Pulls a point of the object towards a target; `None` releases it.
    Drag {
        drag: Option<Drag>,
    },
    /// Cancels the batch.
    CancelBatch,
    /// Saves the attempt as a file.
    ExportRecording,
    /// Searches for grasps of the current object. The search blocks the worker, so the page uses a separate
    /// worker for it.
    SearchGrasps {
        seed: u32,
    },
    /// Starts an attempt with the grasps of a search.
    PlayGrasps {
        seed: u32,
        grasps: String,
        /// Hash of the object that the grasps belong to.
        object_hash: String,
    },
    /// Panics, to test the page's error handling.
    Panic,
}
