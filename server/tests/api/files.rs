//! Static files of the page, and models with their files.

use axum::body::Body;
use axum::http::{Method, Request, StatusCode, header};
use axum::response::Response;
use http_body_util::BodyExt;
use serde_json::Value;
use server::{AppState, app};
use std::fs;
use tempfile::TempDir;
use tower::ServiceExt;

const WEIGHTS: &[u8] = b"0123456789";

/// A page with one hashed script, a model with all files except start configurations, and a folder without
/// weights.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files: [(&str, &[u8]); 9] = [
        ("web/index.html", b"<!doctype html>"),
        ("web/assets/page-a1b2.js", b"plain"),
        ("web/assets/page-a1b2.js.br", b"brotli"),
        ("web/assets/page-a1b2.js.gz", b"gzip"),
        ("web/assets/sim-c3d4.wasm", b"\0asm"),
        ("models/default/weights.safetensors", WEIGHTS),
        ("models/default/config.json", b"{}"),
        ("models/default/card.json", br#"{"lifted":83}"#),
        ("models/draft/card.json", b"{}"),
    ];
    for (name, bytes) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, bytes).expect("a file");
    }
    folder
}

async fn send(folder: &TempDir, request: Request<Body>) -> Response {
    let state = AppState::new(&folder.path().join("web"), &folder.path().join("models"));
    app(state).oneshot(request).await.expect("a response")
}

async fn get_with(folder: &TempDir, path: &str, headers: &[(&str, &str)]) -> Response {
    let request =
        headers.iter().fold(Request::get(path), |r, (name, value)| r.header(*name, *value));
    send(folder, request.body(Body::empty()).expect("a request")).await
}

async fn get(folder: &TempDir, path: &str) -> Response {
    get_with(folder, path, &[]).await
}

async fn bytes(response: Response) -> Vec<u8> {
    response.into_body().collect().await.expect("a body").to_bytes().to_vec()
}

async fn json(response: Response) -> Value {
    serde_json::from_slice(&bytes(response).await).expect("JSON")
}

#[tokio::test]
async fn share_link_with_escaped_hash_redirects_to_the_page() {
    let folder = folder();
    for (path, location) in [
        ("/%23v=1&o=sugar_box", "/#v=1&o=sugar_box"),
        ("/index.html%23v%3D1%26o%3Dcup", "/index.html#v%3D1%26o%3Dcup"),
        ("/%23o=cup&amp;v=1", "/#o=cup&amp;v=1"),
    ] {
        let response = get(&folder, path).await;
        assert_eq!(response.status(), StatusCode::TEMPORARY_REDIRECT, "{path}");
        assert_eq!(response.headers()[header::LOCATION], location);
    }
    // The path could name another host, or is not a share link.
    for path in ["//example.org/%23v=1", "/notes%23v=1", "/%23notes"] {
        assert_eq!(get(&folder, path).await.status(), StatusCode::NOT_FOUND, "{path}");
    }
}

fn header<'a>(response: &'a Response, name: &str) -> &'a str {
    response.headers().get(name).map_or("", |value| value.to_str().expect("text"))
}

async fn assert_problem(response: Response, status: StatusCode, code: &str) {
    assert_eq!(response.status(), status);
    assert_eq!(header(&response, "content-type"), "application/problem+json");
    assert_eq!(header(&response, "x-content-type-options"), "nosniff");
    let problem = json(response).await;
    assert_eq!(problem["status"], status.as_u16());
    assert_eq!(problem["code"], code);
    for member in ["type", "title", "detail", "hint"] {
        assert!(problem[member].as_str().is_some_and(|text| !text.is_empty()), "{member}");
    }
}

#[tokio::test]
async fn page_is_revalidated_and_cross_origin_isolated() {
    let folder = folder();
    let page = get(&folder, "/").await;
    assert_eq!(page.status(), StatusCode::OK);
    assert!(header(&page, "content-type").starts_with("text/html"));
    assert_eq!(header(&page, "cache-control"), "no-cache");
    assert_eq!(header(&page, "cross-origin-opener-policy"), "same-origin");
    assert_eq!(header(&page, "cross-origin-embedder-policy"), "require-corp");
    assert_eq!(header(&page, "referrer-policy"), "no-referrer");
    let policy = header(&page, "content-security-policy");
    assert!(
        policy.contains("'wasm-unsafe-eval'") && !policy.contains(" 'unsafe-eval'"),
        "{policy}"
    );

    let etag = header(&page, "etag").to_owned();
    let again = get_with(&folder, "/", &[("if-none-match", &etag)]).await;
    assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
}

#[tokio::test]
async fn hashed_files_are_immutable_and_precompressed() {
    let folder = folder();
    let path = "/assets/page-a1b2.js";
    for (accepted, encoding, content) in [
        ("br, gzip", "br", "brotli"),
        ("gzip", "gzip", "gzip"),
        ("identity", "", "plain"),
        // Unsatisfiable encodings are ignored.
        ("zstd, identity;q=0", "", "plain"),
    ] {
        let file = get_with(&folder, path, &[("accept-encoding", accepted)]).await;
        assert_eq!(header(&file, "content-encoding"), encoding);
        assert_eq!(header(&file, "vary"), "accept-encoding");
        assert_eq!(header(&file, "content-type"), "text/javascript");
        assert!(header(&file, "cache-control").ends_with("immutable"));
        assert_eq!(bytes(file).await, content.as_bytes());
    }
    let wasm = get(&folder, "/assets/sim-c3d4.wasm").await;
    assert_eq!(header(&wasm, "content-type"), "application/wasm");
}

#[tokio::test]
async fn missing_page_is_reported_as_not_built() {
    let empty = tempfile::tempdir().expect("a temporary folder");
    assert_problem(get(&empty, "/").await, StatusCode::NOT_FOUND, "web_not_built").await;
}

#[tokio::test]
async fn model_list_contains_only_folders_with_weights() {
    let list = json(get(&folder(), "/api/v1/models").await).await;
    assert_eq!(list["object"], "list");
    assert_eq!(list["has_more"], false);
    let models = list["data"].as_array().expect("a list");
    assert_eq!(models.len(), 1);
    assert_eq!(models[0]["id"], "default");
    assert_eq!(models[0]["card"]["lifted"], 83);

    let empty = tempfile::tempdir().expect("a temporary folder");
    let list = json(get(&empty, "/api/v1/models").await).await;
    assert_eq!(list["data"], Value::Array(Vec::new()));
}

#[tokio::test]
async fn default_alias_resolves_to_the_selected_model() {
    let folder = folder();
    let models = folder.path().join("models");
    std::fs::rename(models.join("default"), models.join("chosen")).expect("another name");
    let state = AppState::new(&folder.path().join("web"), &models);
    let get_default = |state: AppState| {
        let request = Request::get("/api/v1/models/default").body(Body::empty());
        app(state).oneshot(request.expect("a request"))
    };
    let missing = get_default(state.clone()).await.expect("a response");
    assert_problem(missing, StatusCode::NOT_FOUND, "model_not_found").await;
    let chosen = get_default(state.with_default_model("chosen")).await.expect("a response");
    assert_eq!(json(chosen).await["id"], "chosen");
}

#[tokio::test]
async fn weights_are_immutable_under_their_hash() {
    let folder = folder();
    let card = json(get(&folder, "/api/v1/models/default").await).await;
    let weights = &card["files"]["weights"];
    assert_eq!(weights["bytes"], WEIGHTS.len());
    assert_eq!(weights["blake3"], blake3::hash(WEIGHTS).to_hex().as_str());
    assert!(card["files"].get("start_configurations").is_none(), "a missing file is listed");

    let url = weights["url"].as_str().expect("a URL");
    let file = get(&folder, url).await;
    assert_eq!(header(&file, "content-type"), "application/octet-stream");
    assert_eq!(header(&file, "etag"), format!("\"{}\"", blake3::hash(WEIGHTS)));
    assert!(header(&file, "cache-control").ends_with("immutable"));
    assert_eq!(bytes(file).await, WEIGHTS);

    let plain = get(&folder, "/api/v1/models/default/weights").await;
    assert_eq!(header(&plain, "cache-control"), "no-cache");
    let stale = get(&folder, "/api/v1/models/default/weights?blake3=00").await;
    assert_problem(stale, StatusCode::NOT_FOUND, "model_changed").await;
}

#[tokio::test]
async fn weights_support_conditional_and_range_requests() {
    let folder = folder();
    let path = "/api/v1/models/default/weights";
    let etag = format!("\"{}\"", blake3::hash(WEIGHTS));

    let known = get_with(&folder, path, &[("if-none-match", &etag)]).await;
    assert_eq!(known.status(), StatusCode::NOT_MODIFIED);
    assert_eq!(header(&known, "etag"), etag);

    let part = get_with(&folder, path, &[("range", "bytes=2-4"), ("if-range", &etag)]).await;
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(header(&part, "content-range"), "bytes 2-4/10");
    assert_eq!(bytes(part).await, b"234");

    let head = Request::head(path).header("range", "bytes=2-4").body(Body::empty());
    let head = send(&folder, head.expect("a request")).await;
    assert_eq!(head.status(), StatusCode::OK);
    assert_eq!(header(&head, "content-length"), "10");

    let other = get_with(&folder, path, &[("range", "bytes=2-4"), ("if-range", "\"old\"")]).await;
    assert_eq!(other.status(), StatusCode::OK);
    assert_eq!(bytes(other).await, WEIGHTS);

    let outside = get_with(&folder, path, &[("range", "bytes=10-")]).await;
    assert_eq!(header(&outside, "content-range"), "bytes */10");
    assert_problem(outside, StatusCode::RANGE_NOT_SATISFIABLE, "range_not_satisfiable").await;
}

#[tokio::test]
async fn files_with_range_support_are_not_compressed() {
    let folder = folder();
    let config = format!("{{\"hidden\":[{}0]}}", "0,".repeat(2000));
    fs::write(folder.path().join("models/default/config.json"), &config).expect("a file");
    let accepted = [("accept-encoding", "gzip")];
    let file = get_with(&folder, "/api/v1/models/default/config", &accepted).await;
    assert_eq!(header(&file, "content-encoding"), "");
    assert_eq!(header(&file, "accept-ranges"), "bytes");
    assert_eq!(header(&file, "content-length"), config.len().to_string());
    assert_eq!(bytes(file).await, config.as_bytes());
}

#[tokio::test]
async fn replaced_weights_are_not_served_under_the_old_hash() {
    let folder = folder();
    let path = "/api/v1/models/default/weights";
    let before = format!("{path}?blake3={}", blake3::hash(WEIGHTS));
    assert_eq!(get(&folder, &before).await.status(), StatusCode::OK);
    let other = vec![7; WEIGHTS.len()];
    fs::write(folder.path().join("models/default/weights.safetensors"), &other).expect("a file");
    assert_problem(get(&folder, &before).await, StatusCode::NOT_FOUND, "model_changed").await;
    assert_eq!(bytes(get(&folder, path).await).await, other);
}

#[tokio::test]
async fn model_stays_usable_when_its_card_is_invalid() {
    let folder = folder();
    std::fs::write(folder.path().join("models/default/card.json"), b"{\"lifted\":")
        .expect("a card");
    for path in ["/api/v1/models", "/api/v1/models/default"] {
        let response = json(get(&folder, path).await).await;
        let model = response["data"].get(0).unwrap_or(&response);
        assert!(model["card"].is_null() && model["files"]["weights"]["bytes"].is_u64(), "{model}");
        assert!(model["card_error"].as_str().is_some_and(|e| e.contains("card.json")), "{model}");
    }
}

#[tokio::test]
async fn errors_are_problem_documents() {
    let folder = folder();
    for (path, code) in [
        ("/api", "not_found"),
        ("/api/v2", "not_found"),
        ("/api/v1/nothing", "not_found"),
        ("/nothing", "not_found"),
        ("/assets/gone.js", "not_found"),
        ("/../models/default/card.json", "not_found"),
        ("/%2e%2e/models/default/card.json", "not_found"),
        ("/..%2fmodels/default/card.json", "not_found"),
        ("/assets/../../models/default/card.json", "not_found"),
        ("/api/v1/models/draft", "model_not_found"),
        ("/api/v1/models/default/start_configurations", "model_file_not_found"),
        ("/api/v1/models/default/card.json", "model_file_not_found"),
    ] {
        assert_problem(get(&folder, path).await, StatusCode::NOT_FOUND, code).await;
    }
    for (path, code) in [
        ("/api/v1/models/..", "invalid_model_id"),
        ("/api/v1/models/%2e%2e%2fdefault", "invalid_model_id"),
        ("/api/v1/models/%ff", "invalid_query"),
    ] {
        assert_problem(get(&folder, path).await, StatusCode::BAD_REQUEST, code).await;
    }
    for (path, allowed) in [
        ("/api/v1/models", "GET,HEAD,POST"),
        ("/api/v1/models/default/weights", "GET,HEAD"),
        ("/healthz", "GET,HEAD"),
        ("/", "GET,HEAD"),
    ] {
        let request = Request::builder().method(Method::DELETE).uri(path).body(Body::empty());
        let response = send(&folder, request.expect("a request")).await;
        assert_eq!(response.headers()[header::ALLOW], allowed, "{path}");
        assert_problem(response, StatusCode::METHOD_NOT_ALLOWED, "method_not_allowed").await;
    }
}

#[tokio::test]
async fn liveness_probe_succeeds_without_a_built_page() {
    let empty = tempfile::tempdir().expect("a temporary folder");
    assert_eq!(json(get(&empty, "/healthz").await).await["status"], "ok");
}
