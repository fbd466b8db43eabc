//! Artifacts: immutable files by hash.

use super::http_content::{Content, IMMUTABLE};
use super::{RequireScheduler, schemas};
use crate::Problem;
use crate::extract::Path;
use crate::jobs::scheduler::JobScheduler;
use axum::http::HeaderMap;
use axum::response::Response;

/// Downloads an artifact.
#[utoipa::path(
    get, path = "/artifacts/{hash}", tag = "artifacts", params(("hash" = String, Path, description = "BLAKE3 (hex)")),
    responses((status = 200, description = "The file", content_type = "*/*", body = schemas::Bytes), (status = 206, description = "The requested range", content_type = "*/*", body = schemas::Bytes), (status = 304, description = "Not modified")),
)]
pub(crate) async fn get(
    RequireScheduler(scheduler): RequireScheduler,
    Path(hash): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    serve(&scheduler, &hash, IMMUTABLE, &headers).await
}

/// Response with the artifact of this hash, with the cache policy `cache`.
pub(super) async fn serve(
    scheduler: &JobScheduler,
    hash: &str,
    cache: &'static str,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let missing = || Problem::record_not_found("artifact", hash);
    let (bytes, content_type) = scheduler.store.artifact(hash).await?.ok_or_else(missing)?;
    let content =
        Content { name: hash, hash: Some(hash), bytes, content_type: &content_type, cache };
    content.respond(headers, async |range| Ok(scheduler.store.read_range(hash, range).await?)).await
}
