//! Responses with file contents: conditional requests, byte ranges and cache policy.

use crate::Problem;
use axum::body::Body;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use http_range_header::parse_range_header;
use std::io::{self, SeekFrom};
use std::ops::Range;
use std::path::Path;
use tokio::fs::File;
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use tokio_util::io::ReaderStream;

/// Cache policy of URLs that contain the content hash.
pub(super) const IMMUTABLE: &str = "public, max-age=31536000, immutable";
/// Cache policy of contents that can change: revalidate each time.
pub(super) const REVALIDATE: &str = "no-cache";
/// Cache policy of contents that are still being written.
pub(super) const NO_STORE: &str = "no-store";

/// Metadata of file contents.
pub(super) struct Content<'a> {
    /// Name in error messages.
    pub(super) name: &'a str,
    /// BLAKE3 (hex), used as ETag; `None` if the file is growing.
    pub(super) hash: Option<&'a str>,
    /// Length (bytes).
    pub(super) bytes: u64,
    /// Media type.
    pub(super) content_type: &'a str,
    /// [`IMMUTABLE`], [`REVALIDATE`] or [`NO_STORE`].
    pub(super) cache: &'static str,
}

/// Part of the contents that a request selects.
#[derive(Debug, PartialEq)]
enum Selection {
    /// None: the client has the current version.
    NotModified,
    /// The complete contents.
    Full,
    /// A byte range.
    Partial(Range<u64>),
    /// A range outside of the contents.
    Unsatisfiable,
}

impl Content<'_> {
    /// Responds to a request with these headers; `body` reads a byte range.
    pub(super) async fn respond(
        &self,
        headers: &HeaderMap,
        body: impl AsyncFnOnce(Range<u64>) -> Result<Body, Problem>,
    ) -> Result<Response, Problem> {
        if let Some(tag) = self.etag() {
            check_if_match(headers, &tag)?;
        }
        let tag = self.etag().map(|tag| [(header::ETAG, tag)]);
        let common = (tag, [(header::CACHE_CONTROL, self.cache), (header::ACCEPT_RANGES, "bytes")]);
        let content_type = [(header::CONTENT_TYPE, self.content_type)];
        let length = |bytes: u64| [(header::CONTENT_LENGTH, bytes)];
        let content_range =
            |range: String| [(header::CONTENT_RANGE, format!("bytes {range}/{}", self.bytes))];
        Ok(match self.select(headers) {
            Selection::NotModified => (StatusCode::NOT_MODIFIED, common).into_response(),
            Selection::Full => {
                let body = body(0..self.bytes).await?;
                (common, content_type, length(self.bytes), body).into_response()
            }
            Selection::Partial(range) => {
                let headers = (
                    length(range.end - range.start),
                    content_range(format!("{}-{}", range.start, range.end - 1)),
                );
                let body = body(range).await?;
                (StatusCode::PARTIAL_CONTENT, common, content_type, headers, body).into_response()
            }
            Selection::Unsatisfiable => {
                (content_range("*".into()), Problem::range_not_satisfiable(self.name))
                    .into_response()
            }
        })
    }

    /// ETag of the contents.
    fn etag(&self) -> Option<String> {
        self.hash.map(|hash| format!("\"{hash}\""))
    }

    /// Evaluates `If-None-Match`, `If-Range` and `Range`.
    fn select(&self, headers: &HeaderMap) -> Selection {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let tag = self.etag();
        if tag.as_deref().is_some_and(|tag| matches_if_none_match(headers, tag)) {
            return Selection::NotModified;
        }
        let is_current =
            !headers.contains_key(header::IF_RANGE) || text(header::IF_RANGE) == tag.as_deref();
        // An invalid range is ignored; empty contents have no ranges.
        let range =
            text(header::RANGE).filter(|range| is_current && !covers_all(range, self.bytes));
        let range = range.and_then(|range| parse_range_header(range).ok());
        // Multiple ranges: the complete contents are a valid response.
        let Some(range) = range.filter(|range| range.ranges.len() == 1) else {
            return Selection::Full;
        };
        match range.validate(self.bytes).as_deref() {
            Ok([range]) => Selection::Partial(*range.start()..*range.end() + 1),
            _ => Selection::Unsatisfiable,
        }
    }
}

/// Whether `If-None-Match` contains this ETag (strong or weak, alone or in a list) or `*`.
pub(super) fn matches_if_none_match(headers: &HeaderMap, etag: &str) -> bool {
    let values = headers.get_all(header::IF_NONE_MATCH).into_iter();
    let values = values.filter_map(|value| value.to_str().ok());
    let mut tags = values.flat_map(|value| value.split(',')).map(str::trim);
    tags.any(|tag| tag == "*" || tag.trim_start_matches("W/") == etag)
}

/// Rejects a request whose `If-Match` does not contain this ETag or `*`. Weak tags never match (RFC 9110, 13.1.1).
pub(super) fn check_if_match(headers: &HeaderMap, etag: &str) -> Result<(), Problem> {
    if !headers.contains_key(header::IF_MATCH) {
        return Ok(());
    }
    let values = headers.get_all(header::IF_MATCH).into_iter();
    let values = values.filter_map(|value| value.to_str().ok());
    let mut tags = values.flat_map(|value| value.split(',')).map(str::trim);
    if tags.any(|tag| tag == "*" || tag == etag) {
        return Ok(());
    }
    Err(Problem::precondition_failed(etag))
}

/// Whether a range covers the complete contents: a suffix of at least their length, or any range of empty
/// contents.
fn covers_all(range: &str, bytes: u64) -> bool {
    let suffix = range.strip_prefix("bytes=-").and_then(|length| length.parse::<u64>().ok());
    bytes == 0 || suffix.is_some_and(|length| length > 0 && length >= bytes)
}

/// Chunk size for reading files (bytes).
const CHUNK: usize = 1 << 16;

/// Body with a byte range of a file.
pub(super) async fn read_range(path: &Path, range: Range<u64>) -> io::Result<Body> {
    let mut file = File::open(path).await?;
    file.seek(SeekFrom::Start(range.start)).await?;
    Ok(Body::from_stream(ReaderStream::with_capacity(file.take(range.end - range.start), CHUNK)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderName;

    fn wanted(bytes: u64, headers: &[(HeaderName, &'static str)]) -> Selection {
        let content = Content {
            name: "file",
            hash: Some("ab"),
            bytes,
            content_type: "text/plain",
            cache: REVALIDATE,
        };
        let headers = headers.iter().map(|(name, value)| (name.clone(), value.parse().unwrap()));
        content.select(&headers.collect())
    }

    #[test]
    fn matching_etag_returns_not_modified() {
        for tags in ["\"ab\"", "W/\"ab\"", "\"x\", \"ab\"", "*"] {
            let known = (header::IF_NONE_MATCH, tags);
            assert_eq!(wanted(10, &[known]), Selection::NotModified, "{tags}");
        }
        for tags in ["\"x\"", "ab", ""] {
            assert_eq!(wanted(10, &[(header::IF_NONE_MATCH, tags)]), Selection::Full, "{tags}");
        }
    }

    #[test]
    fn if_match_compares_strong_tags() {
        let check = |tags: &'static str| {
            let headers = [(header::IF_MATCH, tags.parse().unwrap())].into_iter().collect();
            check_if_match(&headers, "\"ab\"").is_ok()
        };
        assert!(check("\"ab\"") && check("\"x\", \"ab\"") && check("*"));
        assert!(!check("\"x\"") && !check("W/\"ab\"") && !check(""));
        assert!(check_if_match(&HeaderMap::new(), "\"ab\"").is_ok());
    }

    #[test]
    fn single_range_is_partial_and_invalid_range_is_ignored() {
        let range = |range| wanted(10, &[(header::RANGE, range)]);
        assert_eq!(range("bytes=2-4"), Selection::Partial(2..5));
        assert_eq!(range("bytes=2-"), Selection::Partial(2..10));
        assert_eq!(range("bytes=-3"), Selection::Partial(7..10));
        for all in ["bytes=-10", "bytes=-11", "bytes=0-1,40-50", "lines=2-4", "bytes=x"] {
            assert_eq!(range(all), Selection::Full, "{all}");
        }
        for outside in ["bytes=10-", "bytes=10-12"] {
            assert_eq!(range(outside), Selection::Unsatisfiable, "{outside}");
        }
        for of_empty in ["bytes=-1", "bytes=0-", "bytes=0-0", "bytes=4-"] {
            assert_eq!(wanted(0, &[(header::RANGE, of_empty)]), Selection::Full, "{of_empty}");
        }
    }

    #[test]
    fn range_is_ignored_when_if_range_does_not_match() {
        let range = (header::RANGE, "bytes=2-4");
        assert_eq!(
            wanted(10, &[range.clone(), (header::IF_RANGE, "\"ab\"")]),
            Selection::Partial(2..5)
        );
        for other in ["\"old\"", "W/\"ab\"", "*"] {
            assert_eq!(wanted(10, &[range.clone(), (header::IF_RANGE, other)]), Selection::Full);
        }
    }
}
