//! Text of server-sent event streams.
//!
//! Some clients (httpx-sse 0.4) report an event for every blank line after a field, also after a comment or
//! `retry:`. Therefore only events end with a blank line, and the first event contains `retry:`.

use axum::body::Bytes;

/// Time after which a client reconnects (ms).
const RETRY_MS: u32 = 2000;

/// Comment that opens a stream, so that the client receives the response head at once.
pub(super) const OPENING: Bytes = Bytes::from_static(b": events\n");

/// Comment that keeps an idle connection open.
pub(super) const KEEP_ALIVE: Bytes = Bytes::from_static(b": keep-alive\n");

/// An event with JSON data of one line. `is_first`: whether it is the first of the stream.
pub(super) fn event(id: Option<i64>, name: &str, data: &str, is_first: bool) -> Bytes {
    let retry = if is_first { format!("retry: {RETRY_MS}\n") } else { String::new() };
    let id = id.map(|id| format!("id: {id}\n")).unwrap_or_default();
    format!("{retry}{id}event: {name}\ndata: {data}\n\n").into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_events_end_with_a_blank_line() {
        let text = [
            OPENING,
            event(Some(7), "log", "{}", true),
            KEEP_ALIVE,
            event(None, "done", "{}", false),
        ]
        .concat();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(
            text,
            ": events\nretry: 2000\nid: 7\nevent: log\ndata: {}\n\n: keep-alive\nevent: done\ndata: {}\n\n"
        );
    }
}
