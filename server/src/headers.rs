//! Headers that every answer carries.

use crate::observe::REQUEST_ID;
use axum::extract::Request;
use axum::http::{
    Extensions, HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Version, header,
};
use axum::response::Response;
use std::time::Duration;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{Predicate, SizeAbove};
use tower_http::cors::CorsLayer;

/// Nothing but our own files runs or loads. `wasm-unsafe-eval` lets WebAssembly compile and nothing
/// else; `blob:` images are the screenshots that the page makes itself.
const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; \
     worker-src 'self'; connect-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
     font-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

/// Isolation (COOP, COEP: precise timers, and threads if ever wanted), policy, no sniffing.
const HEADERS: [(HeaderName, &str); 6] = [
    (header::CONTENT_SECURITY_POLICY, CONTENT_SECURITY_POLICY),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-embedder-policy"), "require-corp"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
];

/// Adds the headers to an answer.
pub(crate) async fn secure(mut response: Response) -> Response {
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    // What may be kept says so itself.
    if is_json(response.headers()) {
        let kept = response.headers_mut().entry(header::CACHE_CONTROL);
        kept.or_insert(HeaderValue::from_static("no-store"));
    }
    response
}

/// Lets pages of these origins use the API, if there are any.
pub(crate) fn shared(origins: &[HeaderValue]) -> Option<CorsLayer> {
    let header = HeaderName::from_static;
    let sent = [
        header::AUTHORIZATION,
        header::CONTENT_TYPE,
        header::IF_NONE_MATCH,
        header::RANGE,
        header("idempotency-key"),
        header("last-event-id"),
        REQUEST_ID,
    ];
    let read =
        [header::ETAG, header::LOCATION, header::RETRY_AFTER, header::CONTENT_RANGE, REQUEST_ID];
    (!origins.is_empty()).then(|| {
        CorsLayer::new()
            .allow_origin(origins.to_vec())
            .allow_methods([Method::GET, Method::POST, Method::PATCH, Method::DELETE])
            .allow_headers(sent)
            .expose_headers(read)
            .max_age(Duration::from_secs(3600))
    })
}

/// Overlooks what a request asks for in vain. Who refuses the plain form gets it all the same: the compression would
/// answer with 406 when the work is done. A range is meant for GET alone (RFC 9110, 14.2).
pub(crate) async fn lenient(mut request: Request) -> Request {
    let accepted = request.headers().get(header::ACCEPT_ENCODING);
    let accepted = accepted.and_then(|value| value.to_str().ok()).unwrap_or_default();
    if accepted.split(',').any(|one| one.replace(' ', "").ends_with(";q=0")) {
        request.headers_mut().remove(header::ACCEPT_ENCODING);
    }
    if request.method() == Method::HEAD {
        request.headers_mut().remove(header::RANGE);
    }
    request
}

fn is_json(headers: &HeaderMap) -> bool {
    let kind = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    kind.is_some_and(|kind| kind.starts_with("application/json"))
}

/// Shorter answers gain nothing.
const WORTH_COMPRESSING: u64 = 1024;

/// Compresses answers in JSON that are made for who asks. Weights would gain a quarter (gzip -9) and lose ranges; the page is compressed beforehand; a
/// stream must come through as it is.
pub(crate) fn compressed() -> CompressionLayer<impl Predicate> {
    let is_worth_it = |_: StatusCode, _: Version, headers: &HeaderMap, _: &Extensions| {
        // Of what can be had in parts, the parts and the length are those of the plain form.
        is_json(headers) && !headers.contains_key(header::ACCEPT_RANGES)
    };
    CompressionLayer::new().compress_when(SizeAbove::new(WORTH_COMPRESSING).and(is_worth_it))
}
