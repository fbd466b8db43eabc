//! Data URIs in JSON: `data:application/octet-stream;base64,...`.

use base64::Engine;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use std::borrow::Cow;

const START: &[u8] = b"\"data:";

/// Some writers leave the padding out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// JSON without what its data URIs hold, and these: the k-th is `data:k` there. What is parsed is then as small as it
/// would be with the data elsewhere.
pub(super) fn taken_out(json: &[u8]) -> (Cow<'_, [u8]>, Vec<&[u8]>) {
    let (mut rest, mut light, mut held) = (json, Vec::new(), Vec::new());
    while let Some(at) = rest.windows(START.len()).position(|window| window == START) {
        let (before, text) = rest.split_at(at + START.len());
        let Some(end) = text.iter().position(|&byte| byte == b'"') else { break };
        light.extend_from_slice(before);
        light.extend_from_slice(held.len().to_string().as_bytes());
        held.push(&text[..end]);
        rest = &text[end..];
    }
    if held.is_empty() {
        return (Cow::Borrowed(json), held);
    }
    light.extend_from_slice(rest);
    (Cow::Owned(light), held)
}

/// The bytes of what [`taken_out`] found; `None` if they are not written in base 64.
pub(super) fn bytes(held: &[u8]) -> Option<Vec<u8>> {
    let comma = held.iter().position(|&byte| byte == b',')?;
    let (kind, text) = (&held[..comma], &held[comma + 1..]);
    // JSON may write / as \/.
    let text: Vec<u8> = text.iter().copied().filter(|&byte| byte != b'\\').collect();
    kind.ends_with(b";base64").then(|| BASE64.decode(text).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_out_can_be_had_again() {
        let json = br#"{"a":"data:x/y;base64,AQID","b":"data","c":["data:;base64,+\/8="]}"#;
        let (light, held) = taken_out(json);
        assert_eq!(*light, *br#"{"a":"data:0","b":"data","c":["data:1"]}"#);
        assert_eq!(bytes(held[0]), Some(vec![1, 2, 3]));
        assert_eq!(bytes(held[1]), Some(vec![0xfb, 0xff]));
        assert_eq!(bytes(b";base64,+/8"), Some(vec![0xfb, 0xff]));
        for bad in [&b"text/plain,abc"[..], b";base64,A", b";base64", b";base64,####", b""] {
            assert_eq!(bytes(bad), None, "{}", String::from_utf8_lossy(bad));
        }
        assert!(taken_out(b"{}").1.is_empty());
        assert_eq!(*taken_out(b"\"data:cut").0, *b"\"data:cut");
    }
}
