//! Files by their hash, which never change.

use super::content::{Content, KEPT};
use super::{Jobs, answers};
use crate::Problem;
use crate::engine::Engine;
use crate::extract::Path;
use axum::http::HeaderMap;
use axum::response::Response;

/// One file, or a part of it.
#[utoipa::path(
    get, path = "/artifacts/{hash}", tag = "artifacts", params(("hash" = String, Path, description = "BLAKE3, hex")),
    responses((status = 200, description = "The file", content_type = "*/*", body = answers::Bytes), (status = 206, description = "A part of it", content_type = "*/*", body = answers::Bytes), (status = 304, description = "It is as If-None-Match says")),
)]
pub(crate) async fn get(
    Jobs(engine): Jobs,
    Path(hash): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    serve(&engine, &hash, KEPT, &headers).await
}

/// The bytes under a hash, with leave to keep them as `cache` says.
pub(super) async fn serve(
    engine: &Engine,
    hash: &str,
    cache: &'static str,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let missing = || Problem::no_record("artifact", hash);
    let (bytes, content_type) = engine.store.artifact(hash).await?.ok_or_else(missing)?;
    let content =
        Content { name: hash, hash: Some(hash), bytes, content_type: &content_type, cache };
    content.answer(headers, async |part| Ok(engine.store.contents(hash, part).await?)).await
}
