//! Files by their hash, which never change.

use super::Jobs;
use crate::Problem;
use crate::extract::Path;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use http_range_header::parse_range_header;

/// One file, or a part of it.
#[utoipa::path(
    get, path = "/artifacts/{hash}", tag = "artifacts", params(("hash" = String, Path, description = "BLAKE3, hex")),
    responses((status = 200, description = "The file", content_type = "application/octet-stream", body = Vec<u8>), (status = 206, description = "A part of it", content_type = "application/octet-stream", body = Vec<u8>), (status = 304, description = "It is as If-None-Match says")),
)]
pub(crate) async fn get(
    Jobs(engine): Jobs,
    Path(hash): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    serve(&engine, &hash, &headers).await
}

/// The bytes under a hash, with ETag, ranges and leave to keep them for ever.
pub(crate) async fn serve(
    engine: &crate::engine::Engine,
    hash: &str,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let missing = || Problem::no_record("artifact", hash);
    let (bytes, content_type) = engine.store.artifact(hash).await?.ok_or_else(missing)?;
    let tag = format!("\"{hash}\"");
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let common = [
        (header::ETAG, tag.clone()),
        (header::CACHE_CONTROL, "public, max-age=31536000, immutable".into()),
        (header::ACCEPT_RANGES, "bytes".into()),
        (header::CONTENT_TYPE, content_type),
    ];
    let known = text(header::IF_NONE_MATCH);
    if known.is_some_and(|known| known == "*" || known.split(',').any(|one| one.trim() == tag)) {
        return Ok((StatusCode::NOT_MODIFIED, common).into_response());
    }
    let is_same = text(header::IF_RANGE).is_none_or(|known| known == tag);
    let range = text(header::RANGE).filter(|range| is_same && !is_whole(range, bytes));
    let Some(range) = range.and_then(|range| parse_range_header(range).ok()) else {
        let body = engine.store.contents(hash, 0..bytes).await?;
        return Ok((common, body).into_response());
    };
    match range.validate(bytes).as_deref() {
        Ok([one]) => {
            let (first, last) = (*one.start(), *one.end());
            let body = engine.store.contents(hash, first..last + 1).await?;
            let place = [(header::CONTENT_RANGE, format!("bytes {first}-{last}/{bytes}"))];
            Ok((StatusCode::PARTIAL_CONTENT, common, place, body).into_response())
        }
        // Several ranges at once: all of it is as good an answer.
        Ok(_) => {
            let body = engine.store.contents(hash, 0..bytes).await?;
            Ok((common, body).into_response())
        }
        Err(_) => {
            let place = [(header::CONTENT_RANGE, format!("bytes */{bytes}"))];
            Ok((place, Problem::out_of_range(hash)).into_response())
        }
    }
}

/// Whether a range asks for the end of something that is no longer than that end: then it is all of it.
pub(super) fn is_whole(range: &str, bytes: u64) -> bool {
    let end = range.strip_prefix("bytes=-").and_then(|end| end.parse::<u64>().ok());
    end.is_some_and(|end| end > 0 && end >= bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_what_is_short_is_all_of_it() {
        assert!(is_whole("bytes=-10", 10) && is_whole("bytes=-11", 10) && is_whole("bytes=-1", 0));
        for range in ["bytes=-9", "bytes=-0", "bytes=0-", "bytes=-x", "bytes=-5,-5"] {
            assert!(!is_whole(range, 10), "{range}");
        }
    }
}
