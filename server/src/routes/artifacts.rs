//! Artifacts: immutable files by hash.

use super::http_content::{Content, IMMUTABLE};
use super::{RequireScheduler, schemas};
use crate::Problem;
use crate::extract::Path;
use crate::jobs::scheduler::JobScheduler;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::Response;

/// Downloads an artifact.
#[utoipa::path(
    get, path = "/artifacts/{hash}", tag = "artifacts", params(("hash" = String, Path, description = "BLAKE3 (hex)")),
    responses((status = 200, description = "The file", content((schemas::Bytes = "application/octet-stream"), (schemas::Bytes = "*/*"))), (status = 206, description = "The requested range", content((schemas::Bytes = "application/octet-stream"), (schemas::Bytes = "*/*"))), (status = 304, description = "Not modified")),
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
    serve_as(scheduler, hash, bytes, &content_type, cache, headers).await
}

/// Response with the file of a mesh. Its name, which a client has given, does not determine the media type: an SVG
/// file in a browser is a page of this server.
pub(super) async fn serve_mesh(
    scheduler: &JobScheduler,
    hash: &str,
    name: &str,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let missing = || Problem::record_not_found("artifact", hash);
    let (bytes, _) = scheduler.store.artifact(hash).await?.ok_or_else(missing)?;
    let mut response =
        serve_as(scheduler, hash, bytes, "application/octet-stream", IMMUTABLE, headers).await?;
    response.headers_mut().insert(header::CONTENT_DISPOSITION, attachment(name));
    Ok(response)
}

/// Response with an artifact of this media type. Browsers save SVG files instead of displaying them.
async fn serve_as(
    scheduler: &JobScheduler,
    hash: &str,
    bytes: u64,
    content_type: &str,
    cache: &'static str,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let content = Content { name: hash, hash: Some(hash), bytes, content_type, cache };
    let body = async |range| Ok(scheduler.store.read_range(hash, range).await?);
    let mut response = content.respond(headers, body).await?;
    if content_type.starts_with("image/svg") {
        response.headers_mut().insert(header::CONTENT_DISPOSITION, attachment("drawing.svg"));
    }
    Ok(response)
}

/// `Content-Disposition` of a file that browsers save under this name (RFC 6266).
fn attachment(name: &str) -> HeaderValue {
    let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"-._".contains(byte);
    let encode = |byte: u8| match is_plain(&byte) {
        true => char::from(byte).to_string(),
        false => format!("%{byte:02X}"),
    };
    let encoded: String = name.bytes().map(encode).collect();
    let value = HeaderValue::from_str(&format!("attachment; filename*=UTF-8''{encoded}"));
    value.unwrap_or(HeaderValue::from_static("attachment"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attachment_name_is_percent_encoded() {
        assert_eq!(attachment("x.svg"), "attachment; filename*=UTF-8''x.svg");
        assert_eq!(
            attachment("a \"b\"\r\nü.stl"),
            "attachment; filename*=UTF-8''a%20%22b%22%0D%0A%C3%BC.stl"
        );
    }
}
