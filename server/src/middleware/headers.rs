//! Header middleware: security headers, CORS and compression.

use super::request_log::REQUEST_ID;
use axum::extract::Request;
use axum::http::{
    Extensions, HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Version, header,
};
use axum::response::Response;
use std::time::Duration;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{Predicate, SizeAbove};
use tower_http::cors::CorsLayer;

/// Only files of this server load and run. `wasm-unsafe-eval` permits only WebAssembly compilation. `blob:`
/// images are screenshots that the page creates.
const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; \
     worker-src 'self'; connect-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
     font-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; \
     frame-ancestors 'none'";

/// Security headers: content policy, cross-origin isolation (COOP and COEP, for precise timers and threads),
/// no content sniffing, no referrer.
const SECURITY_HEADERS: [(HeaderName, &str); 6] = [
    (header::CONTENT_SECURITY_POLICY, CONTENT_SECURITY_POLICY),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-embedder-policy"), "require-corp"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
];

/// Adds [`SECURITY_HEADERS`] to a response; JSON without a cache policy gets `no-store`.
pub(crate) async fn security_headers(mut response: Response) -> Response {
    for (name, value) in SECURITY_HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    if is_json(response.headers()) {
        let cache_control = response.headers_mut().entry(header::CACHE_CONTROL);
        cache_control.or_insert(HeaderValue::from_static("no-store"));
    }
    response
}

/// CORS layer that allows pages of these origins to use the API; `None` if there are no origins.
pub(crate) fn cors(origins: &[HeaderValue]) -> Option<CorsLayer> {
    let header = HeaderName::from_static;
    let request_headers = [
        header::AUTHORIZATION,
        header::CONTENT_TYPE,
        header::IF_NONE_MATCH,
        header::RANGE,
        header("idempotency-key"),
        header("last-event-id"),
        REQUEST_ID,
    ];
    let response_headers =
        [header::ETAG, header::LOCATION, header::RETRY_AFTER, header::CONTENT_RANGE, REQUEST_ID];
    (!origins.is_empty()).then(|| {
        CorsLayer::new()
            .allow_origin(origins.to_vec())
            .allow_methods([Method::GET, Method::POST, Method::PATCH, Method::DELETE])
            .allow_headers(request_headers)
            .expose_headers(response_headers)
            .max_age(Duration::from_secs(3600))
    })
}

/// Removes request headers that the server cannot satisfy. An `Accept-Encoding` that excludes the identity
/// encoding would make the compression layer respond 406 after the work is done. `Range` applies to GET only
/// (RFC 9110, 14.2).
pub(crate) async fn ignore_unsatisfiable_accept(mut request: Request) -> Request {
    let accepted = request.headers().get(header::ACCEPT_ENCODING);
    let accepted = accepted.and_then(|value| value.to_str().ok()).unwrap_or_default();
    if accepted.split(',').any(|encoding| encoding.replace(' ', "").ends_with(";q=0")) {
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

/// Minimum length of compressed responses (bytes); shorter ones do not benefit.
const MIN_COMPRESSED_BYTES: u64 = 1024;

/// Compresses JSON responses that are generated per request. Weights are not compressed: they would shrink by
/// a quarter (gzip -9) but lose range requests. The page is precompressed. Event streams must not be
/// buffered.
pub(crate) fn compression() -> CompressionLayer<impl Predicate> {
    let is_compressible = |_: StatusCode, _: Version, headers: &HeaderMap, _: &Extensions| {
        // Ranges and the length of a file refer to the uncompressed bytes.
        is_json(headers) && !headers.contains_key(header::ACCEPT_RANGES)
    };
    CompressionLayer::new().compress_when(SizeAbove::new(MIN_COMPRESSED_BYTES).and(is_compressible))
}
