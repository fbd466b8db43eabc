//! Access to the scope of the Web Worker: posting events, and the clock.

use crate::protocol::{Event, Failure};
use serde::Serialize;
use serde_wasm_bindgen::Serializer;
use wasm_bindgen::JsCast;
use web_sys::DedicatedWorkerGlobalScope;

pub(crate) fn post(message: &Event) {
    let serializer = Serializer::new().serialize_missing_as_null(true);
    // A failure to serialise or post a message cannot be reported, since reports are messages too.
    if let Ok(message) = message.serialize(&serializer) {
        scope().post_message(&message).ok();
    }
}

pub(crate) fn invalid_message(error: &serde_wasm_bindgen::Error) -> Failure {
    Failure {
        code: "invalid_message",
        message: format!("The worker received an invalid message: {error}."),
        hint: "Reload the page; it may be older than its worker.".into(),
    }
}

pub(crate) fn scope() -> DedicatedWorkerGlobalScope {
    js_sys::global().unchecked_into()
}

pub(crate) fn now_ms() -> f64 {
    scope().performance().map_or_else(js_sys::Date::now, |performance| performance.now())
}
