//! Fetching a model from the server, with its progress in bytes.

use crate::protocol::Failure;
use js_sys::{Array, Promise, Reflect, Uint8Array};
use serde::Deserialize;
use wasm_bindgen::closure::Closure;
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::JsFuture;
use web_sys::{ReadableStreamDefaultReader, Response, WorkerGlobalScope};

/// The contents of a model's three files.
pub(crate) struct ModelFiles {
    pub(crate) weights: Vec<u8>,
    pub(crate) starts: Vec<u8>,
    pub(crate) config: Vec<u8>,
}

/// The models that the server has.
#[derive(Deserialize)]
struct List {
    data: Vec<Card>,
}

/// A model as the server describes it.
#[derive(Deserialize)]
struct Card {
    id: String,
    files: Files,
}

#[derive(Deserialize)]
struct Files {
    weights: Option<File>,
    starts: Option<File>,
    config: Option<File>,
}

#[derive(Deserialize)]
struct File {
    url: String,
    bytes: f64,
}

/// Fetches the model of this id; `None` if there is none. `base` is where the page lies; `progress` gets bytes done
/// and all, and says whether to go on.
pub(crate) async fn model(
    id: &str,
    base: &str,
    mut progress: impl FnMut(f64, f64) -> bool,
) -> Result<Option<ModelFiles>, Failure> {
    let list = list(base).await?;
    let Some(card) = list.data.into_iter().find(|card| card.id == id) else { return Ok(None) };
    let Files { weights: Some(weights), starts: Some(starts), config: Some(config) } = card.files
    else {
        return Err(failed("weights, start configurations or configuration are missing"));
    };

    let total = weights.bytes + starts.bytes + config.bytes;
    let mut done = 0.0;
    let mut contents = Vec::new();
    for file in [weights, starts, config] {
        // To a server its root is that of the host, and the site may lie in a folder.
        let url = format!("{base}{}", file.url.trim_start_matches('/'));
        let response = get(&url).await?;
        let bytes = read(&response, file.bytes, |bytes| progress(done + bytes, total)).await?;
        if bytes.len() as f64 != file.bytes {
            let (found, wanted) = (bytes.len(), file.bytes);
            return Err(failed(&format!("{} sent {found} bytes instead of {wanted}", file.url)));
        }
        done += file.bytes;
        contents.push(bytes);
    }
    let [weights, starts, config] = <[Vec<u8>; 3]>::try_from(contents)
        .map_err(|files| failed(&format!("{} files came instead of 3", files.len())))?;
    Ok(Some(ModelFiles { weights, starts, config }))
}

/// The models that there are: of the server, or, where only files are served, those that lie beside the page; such a
/// host may answer what it does not know with a page. A list, because asking for a model that is not there would show
/// as an error in the console.
async fn list(base: &str) -> Result<List, Failure> {
    match list_at(&format!("{base}api/v1/models")).await {
        Ok(list) => Ok(list),
        Err(of_server) => list_at(&format!("{base}models/index.json")).await.map_err(|_| of_server),
    }
}

async fn list_at(url: &str) -> Result<List, Failure> {
    let text = get(url).await?.text().map_err(|e| lost(&e))?;
    let text = patiently(text).await?;
    serde_json::from_str(&text.as_string().unwrap_or_default())
        .map_err(|error| failed(&format!("the list of models is not understood: {error}")))
}

/// How long the next bytes may take (ms).
const PATIENCE_MS: i32 = 20_000;

/// Waits for something, but not for ever.
async fn patiently(wanted: Promise) -> Result<JsValue, Failure> {
    let late = Promise::new(&mut |_, reject| {
        let text = JsValue::from(js_sys::Error::new("nothing has come for 20 s"));
        let tell = Closure::once_into_js(move || reject.call1(&JsValue::NULL, &text).is_ok());
        let scope: WorkerGlobalScope = js_sys::global().unchecked_into();
        // Without a timer it is waited for ever.
        let _timer = scope.set_timeout_with_callback_and_timeout_and_arguments_0(
            tell.unchecked_ref(),
            PATIENCE_MS,
        );
    });
    let first = Promise::race(&Array::of2(&wanted, &late));
    JsFuture::from(first).await.map_err(|error| lost(&error))
}

/// An answer that is good.
async fn get(url: &str) -> Result<Response, Failure> {
    let scope: WorkerGlobalScope = js_sys::global().unchecked_into();
    let response = patiently(scope.fetch_with_str(url)).await?;
    let response: Response = response.unchecked_into();
    match response.status() {
        200 => Ok(response),
        status => Err(failed(&format!("{url} answered {status}"))),
    }
}

/// The body, or its beginning if it is longer than `wanted` bytes; `progress` gets the bytes so far, and says whether to
/// go on.
async fn read(
    response: &Response,
    wanted: f64,
    mut progress: impl FnMut(f64) -> bool,
) -> Result<Vec<u8>, Failure> {
    let Some(body) = response.body() else { return Ok(Vec::new()) };
    let reader: ReadableStreamDefaultReader = body.get_reader().unchecked_into();
    let mut bytes = Vec::new();
    loop {
        let chunk = patiently(reader.read()).await?;
        let member = |name: &str| Reflect::get(&chunk, &JsValue::from_str(name));
        if member("done").is_ok_and(|done| done.is_truthy()) {
            return Ok(bytes);
        }
        let value: Uint8Array = member("value").map_err(|e| lost(&e))?.unchecked_into();
        let begin = bytes.len();
        bytes.resize(begin + value.length() as usize, 0);
        value.copy_to(&mut bytes[begin..]);
        let is_too_long = bytes.len() as f64 > wanted;
        if is_too_long || !progress(bytes.len() as f64) {
            // The line is others' from now on.
            let _given_up = reader.cancel();
            return if is_too_long { Ok(bytes) } else { Err(failed("another one is wanted")) };
        }
    }
}

/// The connection broke.
fn lost(error: &JsValue) -> Failure {
    let error: &js_sys::Error = error.unchecked_ref();
    failed(&String::from(error.message()))
}

fn failed(cause: &str) -> Failure {
    Failure {
        code: "model_not_fetched",
        cause: format!("The policy could not be fetched: {cause}."),
        cure: "Check that the server is running, and fetch it again.".into(),
    }
}
