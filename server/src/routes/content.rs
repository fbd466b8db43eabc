//! Bytes as an answer: conditions on their hash, ranges, and how long they may be kept.

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

/// What an address with a hash names never changes.
pub(super) const KEPT: &str = "public, max-age=31536000, immutable";
/// What may be another thing tomorrow is asked for each time.
pub(super) const CHECKED: &str = "no-cache";
/// What is still being written.
pub(super) const NOT_KEPT: &str = "no-store";

/// Bytes that can be asked for, without the bytes.
pub(super) struct Content<'a> {
    /// What a refusal calls it.
    pub(super) name: &'a str,
    /// Its BLAKE3, hex, which is its ETag; `None` if it grows.
    pub(super) hash: Option<&'a str>,
    /// Its length.
    pub(super) bytes: u64,
    pub(super) content_type: &'a str,
    /// One of [`KEPT`], [`CHECKED`] and [`NOT_KEPT`].
    pub(super) cache: &'static str,
}

/// What a request wants of it.
#[derive(Debug, PartialEq)]
enum Wanted {
    /// It has it.
    Nothing,
    All,
    Part(Range<u64>),
    /// What is not there.
    Beyond,
}

impl Content<'_> {
    /// The answer to these headers; `body` gives the bytes of a range.
    pub(super) async fn answer(
        &self,
        headers: &HeaderMap,
        body: impl AsyncFnOnce(Range<u64>) -> Result<Body, Problem>,
    ) -> Result<Response, Problem> {
        let tag = self.tag().map(|tag| [(header::ETAG, tag)]);
        let common = (tag, [(header::CACHE_CONTROL, self.cache), (header::ACCEPT_RANGES, "bytes")]);
        let kind = [(header::CONTENT_TYPE, self.content_type)];
        let long = |bytes: u64| [(header::CONTENT_LENGTH, bytes)];
        let of_all =
            |part: String| [(header::CONTENT_RANGE, format!("bytes {part}/{}", self.bytes))];
        Ok(match self.wanted(headers) {
            Wanted::Nothing => (StatusCode::NOT_MODIFIED, common).into_response(),
            Wanted::All => {
                let body = body(0..self.bytes).await?;
                (common, kind, long(self.bytes), body).into_response()
            }
            Wanted::Part(part) => {
                let place = of_all(format!("{}-{}", part.start, part.end - 1));
                let long = long(part.end - part.start);
                let body = body(part).await?;
                (StatusCode::PARTIAL_CONTENT, common, kind, long, place, body).into_response()
            }
            Wanted::Beyond => {
                (of_all("*".into()), Problem::out_of_range(self.name)).into_response()
            }
        })
    }

    fn tag(&self) -> Option<String> {
        self.hash.map(|hash| format!("\"{hash}\""))
    }

    fn wanted(&self, headers: &HeaderMap) -> Wanted {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let tag = self.tag();
        if tag.as_deref().is_some_and(|tag| is_known(headers, tag)) {
            return Wanted::Nothing;
        }
        let is_same =
            !headers.contains_key(header::IF_RANGE) || text(header::IF_RANGE) == tag.as_deref();
        // What cannot be read counts as not asked for, and nothing has no parts.
        let range = text(header::RANGE).filter(|range| is_same && !is_whole(range, self.bytes));
        let range = range.and_then(|range| parse_range_header(range).ok());
        // Several ranges at once: all of it is as good an answer.
        let Some(range) = range.filter(|range| range.ranges.len() == 1) else {
            return Wanted::All;
        };
        match range.validate(self.bytes).as_deref() {
            Ok([one]) => Wanted::Part(*one.start()..*one.end() + 1),
            _ => Wanted::Beyond,
        }
    }
}

/// Whether `If-None-Match` names this tag, alone or in a list, weakened by a proxy or not, or whatever there is (`*`).
pub(super) fn is_known(headers: &HeaderMap, own: &str) -> bool {
    let values = headers.get_all(header::IF_NONE_MATCH).into_iter();
    let values = values.filter_map(|value| value.to_str().ok());
    let mut tags = values.flat_map(|value| value.split(',')).map(str::trim);
    tags.any(|tag| tag == "*" || tag.trim_start_matches("W/") == own)
}

/// Whether a range is all there is: the end of something that is no longer than that end, or a part of nothing.
fn is_whole(range: &str, bytes: u64) -> bool {
    let end = range.strip_prefix("bytes=-").and_then(|end| end.parse::<u64>().ok());
    bytes == 0 || end.is_some_and(|end| end > 0 && end >= bytes)
}

/// Bytes of a file that are in memory at a time.
const PIECE: usize = 1 << 16;

/// A part of a file.
pub(super) async fn part_of(path: &Path, range: Range<u64>) -> io::Result<Body> {
    let mut file = File::open(path).await?;
    file.seek(SeekFrom::Start(range.start)).await?;
    Ok(Body::from_stream(ReaderStream::with_capacity(file.take(range.end - range.start), PIECE)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderName;

    fn wanted(bytes: u64, headers: &[(HeaderName, &'static str)]) -> Wanted {
        let content = Content {
            name: "it",
            hash: Some("ab"),
            bytes,
            content_type: "text/plain",
            cache: CHECKED,
        };
        let headers = headers.iter().map(|(name, value)| (name.clone(), value.parse().unwrap()));
        content.wanted(&headers.collect())
    }

    #[test]
    fn who_has_it_needs_nothing() {
        for tags in ["\"ab\"", "W/\"ab\"", "\"x\", \"ab\"", "*"] {
            let known = (header::IF_NONE_MATCH, tags);
            assert_eq!(wanted(10, &[known]), Wanted::Nothing, "{tags}");
        }
        for tags in ["\"x\"", "ab", ""] {
            assert_eq!(wanted(10, &[(header::IF_NONE_MATCH, tags)]), Wanted::All, "{tags}");
        }
    }

    #[test]
    fn one_range_is_a_part_and_what_cannot_be_read_is_all() {
        let range = |range| wanted(10, &[(header::RANGE, range)]);
        assert_eq!(range("bytes=2-4"), Wanted::Part(2..5));
        assert_eq!(range("bytes=2-"), Wanted::Part(2..10));
        assert_eq!(range("bytes=-3"), Wanted::Part(7..10));
        for all in ["bytes=-10", "bytes=-11", "bytes=0-1,40-50", "lines=2-4", "bytes=x"] {
            assert_eq!(range(all), Wanted::All, "{all}");
        }
        for beyond in ["bytes=10-", "bytes=10-12"] {
            assert_eq!(range(beyond), Wanted::Beyond, "{beyond}");
        }
        for of_nothing in ["bytes=-1", "bytes=0-", "bytes=0-0", "bytes=4-"] {
            assert_eq!(wanted(0, &[(header::RANGE, of_nothing)]), Wanted::All, "{of_nothing}");
        }
    }

    #[test]
    fn a_part_of_something_else_is_all_of_this() {
        let range = (header::RANGE, "bytes=2-4");
        assert_eq!(wanted(10, &[range.clone(), (header::IF_RANGE, "\"ab\"")]), Wanted::Part(2..5));
        for other in ["\"old\"", "W/\"ab\"", "*"] {
            assert_eq!(wanted(10, &[range.clone(), (header::IF_RANGE, other)]), Wanted::All);
        }
    }
}
