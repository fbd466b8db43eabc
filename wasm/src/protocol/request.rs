//! Requests of the page to the simulation.

use super::{BatchAttempt, Drag, PlanarPose};
use js_sys::{Object, Reflect};
use objects::import::Orientation;
use serde::Deserialize;
use serde_bytes::ByteBuf;
use wasm_bindgen::JsValue;

/// Request to the simulation. In JavaScript, `kind` is a field next to the others.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "SimRequest", tag = "kind"))]
#[serde(rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(crate) enum Request {
    LoadObject {
        object: String,
    },
    /// A mesh in the bytes of module `mesh-reader`, or a demonstration or a recorded attempt (JSON).
    Upload {
        file_name: String,
        #[serde(with = "serde_bytes")]
        #[cfg_attr(test, ts(type = "ArrayBuffer"))]
        bytes: Vec<u8>,
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
        /// Number of workers that execute it, with this one.
        workers: u32,
    },
    /// Takes seeds of the batch for another worker.
    TakeAttempts {
        batch_id: u32,
        /// Number of the worker, part of the resulting event.
        worker: u32,
    },
    /// Counts an attempt of the batch that another worker has executed.
    CountAttempt {
        batch_id: u32,
        attempt: BatchAttempt,
    },
    /// Pulls a point of the object towards a target; `None` releases it.
    Drag {
        drag: Option<Drag>,
    },
    /// Cancels the batch.
    CancelBatch,
    /// Saves the attempt as a file.
    ExportRecording,
    /// Starts a search for grasps of the current object. The worker decides on tasks; the page distributes them
    /// to several workers with the same object.
    SearchGrasps {
        is_long: bool,
    },
    CancelSearch,
    /// Loads the object of a search or batch that another worker has started.
    LoadObjectBytes {
        #[serde(with = "serde_bytes")]
        #[cfg_attr(test, ts(type = "Uint8Array"))]
        object: Vec<u8>,
    },
    /// Executes a task of a search with this seed and length. It blocks the worker for up to a second.
    RunSearchTask {
        seed: u32,
        is_long: bool,
        /// Index of the task in its batch.
        index: usize,
        #[serde(with = "serde_bytes")]
        #[cfg_attr(test, ts(type = "Uint8Array"))]
        task: Vec<u8>,
    },
    /// Results of a batch of tasks, in their order.
    CompleteSearchBatch {
        #[cfg_attr(test, ts(type = "Array<Uint8Array>"))]
        results: Vec<ByteBuf>,
    },
    /// Starts an attempt with grasps of a search, the first reachable one.
    PlayGrasps {
        seed: u32,
        #[cfg_attr(test, ts(type = "Array<Uint8Array>"))]
        grasps: Vec<ByteBuf>,
        /// Hash of the object that the grasps belong to.
        object_hash: String,
    },
    /// Panics, to test the page's error handling.
    Panic,
}

impl Request {
    /// Parses a message `{ kind, ...fields }` as `{ [kind]: fields }`. With `serde(tag)`, the code that buffers
    /// the fields would add 5 kB to the page.
    pub(crate) fn from_message(message: &JsValue) -> Result<Self, serde_wasm_bindgen::Error> {
        let kind = Reflect::get(message, &"kind".into())?;
        if Reflect::own_keys(message)?.length() == 1 {
            return serde_wasm_bindgen::from_value(kind);
        }
        let tagged = Object::new();
        Reflect::set(&tagged, &kind, message)?;
        serde_wasm_bindgen::from_value(tagged.into())
    }
}

#[cfg(all(test, target_arch = "wasm32"))]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test;

    fn parse(json: &str) -> Result<Request, String> {
        let message = js_sys::JSON::parse(json).unwrap();
        Request::from_message(&message).map_err(|error| error.to_string())
    }

    #[wasm_bindgen_test]
    fn kind_selects_the_request_and_the_other_fields_are_its_own() {
        assert!(matches!(parse(r#"{"kind":"pause"}"#), Ok(Request::Pause)));
        let batch = parse(r#"{"seed":3,"attempts":20,"kind":"batch","batchId":7,"workers":2}"#);
        assert!(matches!(
            batch,
            Ok(Request::Batch { seed: 3, attempts: 20, batch_id: 7, workers: 2 })
        ));
        assert!(matches!(
            parse(r#"{"kind":"drag","drag":null}"#),
            Ok(Request::Drag { drag: None })
        ));
    }

    #[wasm_bindgen_test]
    fn invalid_messages_are_errors_with_their_cause() {
        assert!(parse(r#"{"kind":"jump"}"#).unwrap_err().contains("jump"));
        assert!(parse(r#"{"kind":"grasp"}"#).is_err());
        assert!(parse(r#"{"kind":"grasp","seed":-1}"#).is_err());
        assert!(parse("{}").is_err());
        assert!(parse("3").is_err());
    }
}
