//! GLB: a header, a chunk of JSON and a chunk of binary data.

use super::gltf::{FORMAT, malformed, unsupported};
use super::parse::excerpt;
use crate::{Location, MeshError};

pub(super) fn is_glb(bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
}

/// Byte offset of the JSON chunk, the JSON chunk, and the binary chunk of a GLB file.
pub(super) fn glb_chunks(bytes: &[u8]) -> Result<(usize, &[u8], &[u8]), MeshError> {
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|w| w.try_into().ok()).map(u32::from_le_bytes);
        word.ok_or_else(|| truncated(at as u64 + 4, bytes.len()))
    };
    let (version, length) = (word(4)?, word(8)?);
    if version != 2 {
        return Err(unsupported(format!("glTF version {version}")));
    }
    if length as usize > bytes.len() {
        return Err(truncated(u64::from(length), bytes.len()));
    }
    let mut chunks: [&[u8]; 2] = [&[]; 2];
    let mut at = 12;
    while at + 8 <= bytes.len() {
        let (length, kind) = (u64::from(word(at)?), &bytes[at + 4..at + 8]);
        let end = at as u64 + 8 + length;
        let data = bytes.get(at + 8..usize::try_from(end).unwrap_or(usize::MAX));
        let data = data.ok_or_else(|| truncated(end, bytes.len()))?;
        match kind {
            b"JSON" => chunks[0] = data,
            b"BIN\0" => chunks[1] = data,
            _ if at == 12 => {
                return Err(malformed(Location::Byte(16), "a JSON chunk first", excerpt(kind)));
            }
            _ => {}
        }
        at += 8 + data.len();
    }
    // Some exporters pad the JSON with zeros instead of spaces.
    let end = chunks[0].iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    Ok((20, &chunks[0][..end], chunks[1]))
}

fn truncated(expected: u64, found: usize) -> MeshError {
    let (expected, found) = (format!("{expected} bytes"), found.to_string());
    MeshError::Truncated { format: FORMAT, expected, found }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read;
    use crate::test_meshes;

    #[test]
    fn truncated_file_is_reported() {
        let bytes = test_meshes::glb(&test_meshes::cube());
        for cut in [6, 12, 100, bytes.len() - 1] {
            let error = read(&bytes[..cut]).unwrap_err();
            assert!(matches!(error, MeshError::Truncated { .. }), "{cut}: {error}");
        }
        let old = [&bytes[..4], &[1, 0, 0, 0], &bytes[8..]].concat();
        assert!(matches!(read(&old), Err(MeshError::Unsupported { .. })));
    }

    #[test]
    fn json_padded_with_zeros_is_read() {
        let bytes = test_meshes::glb(&test_meshes::cube());
        let length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
        let mut padded = bytes.clone();
        padded.splice(20 + length..20 + length, [0; 4]);
        for (at, value) in [(8, bytes.len() + 4), (12, length + 4)] {
            padded[at..at + 4].copy_from_slice(&(value as u32).to_le_bytes());
        }
        assert_eq!(read(&padded), Ok(test_meshes::cube()));
    }
}
