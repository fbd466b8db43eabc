//! Data URIs in JSON: `data:application/octet-stream;base64,...`.

use base64::Engine;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use std::borrow::Cow;

const PREFIX: &[u8] = b"\"data:";

/// Padding is optional, because some exporters omit it.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Replaces the content of each data URI in JSON by its index (`data:k`); returns the JSON and the contents.
///
/// The JSON to parse is then as small as with external buffers.
pub(super) fn extract_data_uris(json: &[u8]) -> (Cow<'_, [u8]>, Vec<&[u8]>) {
    let (mut rest, mut stripped, mut contents) = (json, Vec::new(), Vec::new());
    while let Some(start) = rest.windows(PREFIX.len()).position(|window| window == PREFIX) {
        let (before, text) = rest.split_at(start + PREFIX.len());
        let Some(end) = text.iter().position(|&byte| byte == b'"') else { break };
        stripped.extend_from_slice(before);
        stripped.extend_from_slice(contents.len().to_string().as_bytes());
        contents.push(&text[..end]);
        rest = &text[end..];
    }
    if contents.is_empty() {
        return (Cow::Borrowed(json), contents);
    }
    stripped.extend_from_slice(rest);
    (Cow::Owned(stripped), contents)
}

/// Decodes a content returned by [`extract_data_uris`]; `None` if it is not base64.
pub(super) fn decode(content: &[u8]) -> Option<Vec<u8>> {
    let comma = content.iter().position(|&byte| byte == b',')?;
    let (media_type, text) = (&content[..comma], &content[comma + 1..]);
    // JSON may escape / as \/.
    let text: Vec<u8> = text.iter().copied().filter(|&byte| byte != b'\\').collect();
    media_type.ends_with(b";base64").then(|| BASE64.decode(text).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extracted_data_uris_decode_to_their_bytes() {
        let json = br#"{"a":"data:x/y;base64,AQID","b":"data","c":["data:;base64,+\/8="]}"#;
        let (stripped, contents) = extract_data_uris(json);
        assert_eq!(*stripped, *br#"{"a":"data:0","b":"data","c":["data:1"]}"#);
        assert_eq!(decode(contents[0]), Some(vec![1, 2, 3]));
        assert_eq!(decode(contents[1]), Some(vec![0xfb, 0xff]));
        assert_eq!(decode(b";base64,+/8"), Some(vec![0xfb, 0xff]));
        for bad in [&b"text/plain,abc"[..], b";base64,A", b";base64", b";base64,####", b""] {
            assert_eq!(decode(bad), None, "{}", String::from_utf8_lossy(bad));
        }
        assert!(extract_data_uris(b"{}").1.is_empty());
        assert_eq!(*extract_data_uris(b"\"data:cut").0, *b"\"data:cut");
    }
}
