//! Parts shared by the parsers: lines, tokens, numbers and limits.

use crate::MeshError;

/// Whether the first 1000 bytes are text in ASCII, UTF-8 or Latin-1.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    bytes.iter().take(1000).all(|&b| b >= b' ' || b.is_ascii_whitespace())
}

/// Iterator over lines and their numbers (from 1); a line ends with \n, \r\n or \r.
pub(super) struct LineReader<'a> {
    /// Bytes after the last returned line.
    pub(super) rest: &'a [u8],
    number: usize,
}

impl<'a> LineReader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, number: 0 }
    }
}

impl<'a> Iterator for LineReader<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let is_end = |&b: &u8| b == b'\n' || b == b'\r';
        let end = self.rest.iter().position(is_end).unwrap_or(self.rest.len());
        let (line, tail) = self.rest.split_at(end);
        if line.is_empty() && tail.is_empty() {
            return None;
        }
        self.rest = tail.strip_prefix(b"\r\n").unwrap_or(tail.get(1..).unwrap_or(&[]));
        self.number += 1;
        Some((self.number, line))
    }
}

/// Tokens of a line, separated by ASCII white space.
pub(super) fn tokens(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|token| !token.is_empty())
}

/// Tokens of a text with the numbers of their lines.
pub(super) fn numbered_tokens(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    LineReader::new(bytes).flat_map(|(line, text)| tokens(text).map(move |token| (line, token)))
}

/// Parses a decimal number, `nan` or `inf`.
///
/// Accepts a decimal comma (`1,5`), as exporters write it in some locales, and a Fortran exponent (`1.5D+00`).
pub(super) fn parse_number(token: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(token).ok()?;
    text.parse().ok().or_else(|| {
        let is_numeric = |b: &u8| {
            matches!(b, b'0'..=b'9' | b'+' | b'-' | b'.' | b',' | b'd' | b'D' | b'e' | b'E')
        };
        let has_digits = token.iter().all(is_numeric) && token.iter().any(u8::is_ascii_digit);
        has_digits.then(|| text.replace(',', ".").replace(['d', 'D'], "e").parse().ok()).flatten()
    })
}

/// Parses the first three tokens as coordinates.
///
/// The error is the invalid token, quoted, or "the end of the line".
pub(super) fn parse_coordinates<'a>(
    mut tokens: impl Iterator<Item = &'a [u8]>,
) -> Result<[f64; 3], String> {
    let mut next = || {
        let token = tokens.next().ok_or("the end of the line")?;
        parse_number(token).ok_or_else(|| excerpt(token))
    };
    Ok([next()?, next()?, next()?])
}

/// First 40 bytes, quoted and escaped for an error message.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    let head = &bytes[..bytes.len().min(40)];
    let ellipsis = if head.len() < bytes.len() { "..." } else { "" };
    format!("\"{}{ellipsis}\"", String::from_utf8_lossy(head).escape_debug())
}

/// Fails if `found` items (`what`, plural) exceed `limit`.
pub(super) fn check_limit(what: &'static str, found: u64, limit: usize) -> Result<(), MeshError> {
    let limit = limit as u64;
    if found > limit { Err(MeshError::TooMany { what, found, limit }) } else { Ok(()) }
}
