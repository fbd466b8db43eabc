//! Encodings around a mesh file: gzip and UTF-16.

use super::MAX_BYTES;
use crate::{Location, MeshError};
use flate2::read::MultiGzDecoder;
use std::io::Read;

pub(super) fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x1f\x8b\x08")
}

/// Decompresses up to [`MAX_BYTES`] and one byte, which shows that the limit is exceeded.
pub(super) fn gunzip(bytes: &[u8]) -> Result<Vec<u8>, MeshError> {
    let mut content = Vec::new();
    let mut limited = MultiGzDecoder::new(bytes).take(MAX_BYTES as u64 + 1);
    limited.read_to_end(&mut content).map_err(|error| MeshError::Malformed {
        format: "gzip",
        location: Location::Byte(0),
        expected: "a complete archive",
        found: error.to_string(),
    })?;
    Ok(content)
}

/// Text in UTF-8, if the bytes begin with the byte order mark of UTF-16.
pub(super) fn utf16_to_utf8(bytes: &[u8]) -> Option<Vec<u8>> {
    let (mark, content) = bytes.split_at_checked(2)?;
    let decode: fn([u8; 2]) -> u16 = match mark {
        b"\xff\xfe" => u16::from_le_bytes,
        b"\xfe\xff" => u16::from_be_bytes,
        _ => return None,
    };
    let units = content.as_chunks::<2>().0.iter().map(|pair| decode(*pair));
    let text: String =
        char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Some(text.into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read;
    use crate::test_meshes;
    use flate2::Compression;
    use flate2::write::GzEncoder;
    use std::io::Write;

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn compressed_file_is_read_in_every_format() {
        for (name, bytes) in test_meshes::all(&test_meshes::cube()) {
            let mesh = read(&gzip(&bytes)).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(test_meshes::volume(&mesh), 1.0, "{name}");
        }
        let cut = &gzip(&test_meshes::obj(&test_meshes::cube()))[..40];
        let error = read(cut).unwrap_err().to_string();
        assert!(error.contains("gzip") && error.contains("a complete archive"), "{error}");
    }

    #[test]
    fn compressed_content_above_the_limit_is_rejected() {
        let error = read(&gzip(&vec![b' '; MAX_BYTES + 100])).unwrap_err();
        assert_eq!(error, MeshError::TooLarge { found: MAX_BYTES + 1, limit: MAX_BYTES });
    }

    #[test]
    fn text_is_read_with_every_byte_order_mark_and_line_ending() {
        let cube = test_meshes::cube();
        for bytes in [test_meshes::obj(&cube), test_meshes::stl_text(&cube)] {
            let text = String::from_utf8(bytes).unwrap().replace('\n', "\r\n");
            let units: Vec<u16> = text.encode_utf16().collect();
            let little: Vec<u8> = units.iter().flat_map(|u| u.to_le_bytes()).collect();
            let big: Vec<u8> = units.iter().flat_map(|u| u.to_be_bytes()).collect();
            for (mark, content) in [
                (&b"\xff\xfe"[..], &little),
                (b"\xfe\xff", &big),
                (b"\xef\xbb\xbf", &text.clone().into_bytes()),
                (b"", &text.replace("\r\n", "\r").into_bytes()),
            ] {
                let mesh = read(&[mark, content].concat()).unwrap();
                assert_eq!(test_meshes::volume(&mesh), 1.0, "{mark:?}");
            }
        }
    }
}
