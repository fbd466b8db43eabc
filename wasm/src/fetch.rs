//! Download of a model, with progress in bytes.

use crate::protocol::Failure;
use js_sys::{Array, Promise, Reflect, Uint8Array};
use serde::Deserialize;
use wasm_bindgen::closure::Closure;
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::JsFuture;
use web_sys::{ReadableStreamDefaultReader, Response, WorkerGlobalScope};

/// Contents of a model's three files.
pub(crate) struct ModelFiles {
    pub(crate) weights: Vec<u8>,
    pub(crate) start_configurations: Vec<u8>,
    pub(crate) config: Vec<u8>,
}

/// Response of the server's model list.
#[derive(Deserialize)]
struct ModelList {
    data: Vec<ModelEntry>,
}

/// Model in the list.
#[derive(Deserialize)]
struct ModelEntry {
    id: String,
    files: ModelFileUrls,
}

#[derive(Deserialize)]
struct ModelFileUrls {
    weights: Option<RemoteFile>,
    start_configurations: Option<RemoteFile>,
    config: Option<RemoteFile>,
}

#[derive(Deserialize)]
struct RemoteFile {
    url: String,
    bytes: f64,
}

/// Downloads the model with this id; `None` if the list does not contain it. `base` is the URL of the page.
/// `progress` receives the downloaded and the total bytes, and returns whether to continue.
pub(crate) async fn fetch_model(
    id: &str,
    base: &str,
    mut progress: impl FnMut(f64, f64) -> bool,
) -> Result<Option<ModelFiles>, Failure> {
    let list = fetch_list(base).await?;
    let Some(card) = list.data.into_iter().find(|card| card.id == id) else { return Ok(None) };
    let ModelFileUrls {
        weights: Some(weights),
        start_configurations: Some(starts),
        config: Some(config),
    } = card.files
    else {
        return Err(download_error("weights, start configurations or configuration are missing"));
    };

    let total = weights.bytes + starts.bytes + config.bytes;
    let mut done = 0.0;
    let mut contents = Vec::new();
    for file in [weights, starts, config] {
        // The URL is relative to the root of the site, which can be in a folder of the host.
        let url = format!("{base}{}", file.url.trim_start_matches('/'));
        let response = fetch_ok(&url).await?;
        let bytes = read_body(&response, file.bytes, |bytes| progress(done + bytes, total)).await?;
        if bytes.len() as f64 != file.bytes {
            let (found, expected) = (bytes.len(), file.bytes);
            return Err(download_error(&format!(
                "{} returned {found} bytes instead of {expected}",
                file.url
            )));
        }
        done += file.bytes;
        contents.push(bytes);
    }
    let [weights, starts, config] = <[Vec<u8>; 3]>::try_from(contents)
        .map_err(|files| download_error(&format!("received {} files instead of 3", files.len())))?;
    Ok(Some(ModelFiles { weights, start_configurations: starts, config }))
}

/// List of models: from the server's API, or on a static host from the files next to the page. A static host
/// may answer an unknown URL with an HTML page, so an invalid list counts as missing. A list is fetched
/// because requests for missing models would show as errors in the console.
async fn fetch_list(base: &str) -> Result<ModelList, Failure> {
    match fetch_list_from(&format!("{base}api/v1/models")).await {
        Ok(list) => Ok(list),
        Err(error) => fetch_list_from(&format!("{base}models/index.json")).await.map_err(|_| error),
    }
}

async fn fetch_list_from(url: &str) -> Result<ModelList, Failure> {
    let text = fetch_ok(url).await?.text().map_err(|e| connection_error(&e))?;
    let text = with_timeout(text).await?;
    serde_json::from_slice(text.as_string().unwrap_or_default().as_bytes())
        .map_err(|error| download_error(&format!("the model list is invalid: {error}")))
}

/// Timeout of a response or of the next chunk of its body (ms).
const CHUNK_TIMEOUT_MS: i32 = 20_000;

/// Awaits a promise with a timeout.
async fn with_timeout(promise: Promise) -> Result<JsValue, Failure> {
    let timeout = Promise::new(&mut |_, reject| {
        let text = JsValue::from(js_sys::Error::new("no data received for 20 s"));
        let reject = Closure::once_into_js(move || reject.call1(&JsValue::NULL, &text).is_ok());
        let scope: WorkerGlobalScope = js_sys::global().unchecked_into();
        // Without a timer, the wait is unlimited.
        let _timer = scope.set_timeout_with_callback_and_timeout_and_arguments_0(
            reject.unchecked_ref(),
            CHUNK_TIMEOUT_MS,
        );
    });
    let first = Promise::race(&Array::of2(&promise, &timeout));
    JsFuture::from(first).await.map_err(|error| connection_error(&error))
}

/// Fetches a URL; any status except 200 is an error.
async fn fetch_ok(url: &str) -> Result<Response, Failure> {
    let scope: WorkerGlobalScope = js_sys::global().unchecked_into();
    let response = with_timeout(scope.fetch_with_str(url)).await?;
    let response: Response = response.unchecked_into();
    match response.status() {
        200 => Ok(response),
        status => Err(download_error(&format!("{url} returned HTTP {status}"))),
    }
}

/// Reads the body, and stops as soon as it exceeds `expected` bytes. `progress` receives the bytes so far and
/// returns whether to continue.
async fn read_body(
    response: &Response,
    expected: f64,
    mut progress: impl FnMut(f64) -> bool,
) -> Result<Vec<u8>, Failure> {
    let Some(body) = response.body() else { return Ok(Vec::new()) };
    let reader: ReadableStreamDefaultReader = body.get_reader().unchecked_into();
    let mut bytes = Vec::new();
    loop {
        let chunk = with_timeout(reader.read()).await?;
        let member = |name: &str| Reflect::get(&chunk, &JsValue::from_str(name));
        if member("done").is_ok_and(|done| done.is_truthy()) {
            return Ok(bytes);
        }
        let value: Uint8Array = member("value").map_err(|e| connection_error(&e))?.unchecked_into();
        let start = bytes.len();
        bytes.resize(start + value.length() as usize, 0);
        value.copy_to(&mut bytes[start..]);
        let is_too_long = bytes.len() as f64 > expected;
        if is_too_long || !progress(bytes.len() as f64) {
            // Frees the connection for other requests.
            let _cancelled = reader.cancel();
            return if is_too_long {
                Ok(bytes)
            } else {
                Err(download_error("another policy was requested"))
            };
        }
    }
}

/// Error of the connection.
fn connection_error(error: &JsValue) -> Failure {
    let error: &js_sys::Error = error.unchecked_ref();
    download_error(&String::from(error.message()))
}

fn download_error(cause: &str) -> Failure {
    Failure {
        code: "model_download_failed",
        message: format!("The policy could not be downloaded: {cause}."),
        hint: "Check that the server is running, and retry.".into(),
    }
}
