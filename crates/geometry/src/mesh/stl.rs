//! STL: a soup of triangles, as text or in binary records of 50 bytes.

use super::read::{Draft, Lines, coordinates, excerpt, is_text as is_plain_text, words};
use super::{Mesh, MeshError, Place};

const FORMAT: &str = "STL";
/// Free text, then the number of triangles (bytes).
const HEADER: usize = 84;
/// Normal, three corners, attribute (bytes).
const RECORD: usize = 50;

/// Whether this is a text STL, whole or cut.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    let first = Lines::new(bytes).map(|(_, line)| line.trim_ascii()).find(|line| !line.is_empty());
    let word = first.and_then(|line| words(line).next()).unwrap_or_default();
    word.eq_ignore_ascii_case(b"solid") && is_plain_text(bytes)
}

/// Whether this is a binary STL, whole or cut; its header may well begin with "solid".
///
/// There is no magic number. A whole one has the length that its count asks for, which no text can have: four
/// printable characters count over 100 million triangles. A cut one begins with a plausible record.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    let Some(count) = count(bytes) else { return false };
    let is_whole = (count > 0 || bytes.len() == HEADER) && missing_or_extra(bytes, count) == 0;
    let has_record = bytes.get(HEADER..HEADER + RECORD).is_some_and(is_plausible);
    is_whole || (count > 0 && has_record && !is_plain_text(bytes))
}

/// The number of triangles that the header promises.
fn count(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER - 4..HEADER)?;
    Some(u32::from_le_bytes(count.try_into().ok()?))
}

/// Bytes after the last promised record (a final line break aside), negative if some are missing.
fn missing_or_extra(bytes: &[u8], count: u32) -> i64 {
    let extra = bytes.len() as i64 - (HEADER as i64 + i64::from(count) * RECORD as i64);
    match extra {
        1 if bytes.ends_with(b"\n") => 0,
        2 if bytes.ends_with(b"\r\n") => 0,
        _ => extra,
    }
}

/// Whether a record has a normal of length 1 or 0 and corners of sane size.
fn is_plausible(record: &[u8]) -> bool {
    let floats = floats(record);
    let length = floats[..3].iter().map(|x| x * x).sum::<f64>().sqrt();
    let is_normal = length == 0.0 || (0.9..1.1).contains(&length);
    is_normal && floats.iter().all(|x| x.abs() < 1e9)
}

fn floats(record: &[u8]) -> [f64; 12] {
    let mut floats = [0.0; 12];
    for (float, &bytes) in floats.iter_mut().zip(record.as_chunks::<4>().0) {
        *float = f64::from(f32::from_le_bytes(bytes));
    }
    floats
}

/// Reads a binary STL; the length is checked against the header before anything is read.
pub(super) fn read_binary(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let count = count(bytes).unwrap_or(0);
    let extra = missing_or_extra(bytes, count);
    let (records, _) = bytes.get(HEADER..).unwrap_or(&[]).as_chunks::<RECORD>();
    if extra < 0 {
        return Err(MeshError::Truncated {
            format: FORMAT,
            expected: format!("{count} triangles, as its header says"),
            found: format!("{} in {} bytes", records.len(), bytes.len()),
        });
    }
    if extra > 0 {
        return Err(MeshError::Malformed {
            format: FORMAT,
            place: Place::Byte(HEADER - 4),
            expected: "the number of triangles in the file",
            found: format!("{count}, while there are bytes for {}", records.len()),
        });
    }
    let mut draft = Draft::new(FORMAT, 0);
    for (i, record) in records.iter().enumerate() {
        let place = Place::Byte(HEADER + i * RECORD);
        let floats = floats(record);
        let (corners, _) = floats[3..].as_chunks::<3>();
        triangle(&mut draft, corners.iter().copied(), place)?;
    }
    draft.finish()
}

fn triangle(
    draft: &mut Draft,
    corners: impl Iterator<Item = [f64; 3]>,
    place: Place,
) -> Result<(), MeshError> {
    let first = draft.num_vertices() as u32;
    for corner in corners {
        draft.vertex(corner, place)?;
    }
    let corners: Vec<u32> = (first..draft.num_vertices() as u32).collect();
    draft.polygon(&corners, place)
}

/// Reads a text STL, its solids as one mesh; keywords in any case.
pub(super) fn read_text(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut draft = Draft::new(FORMAT, 0);
    let mut corners: Vec<[f64; 3]> = Vec::new();
    let mut facet = None;
    let mut is_ended = false;
    let mut all = Lines::new(bytes).peekable();
    while let Some((line, text)) = all.next() {
        // The last line may be wrong because the file was cut there.
        let is_cut = all.peek().is_none() && !bytes.ends_with(b"\n") && !is_ended;
        let place = Place::Line(line);
        let mut words = words(text);
        let keyword = words.next().unwrap_or_default().to_ascii_lowercase();
        let malformed =
            |expected, found| MeshError::Malformed { format: FORMAT, place, expected, found };
        match (&keyword[..], facet) {
            (b"" | b"outer" | b"endloop", _) => {}
            (b"solid", None) => is_ended = false,
            (b"endsolid", None) => is_ended = true,
            (b"facet", None) => facet = Some(place),
            (b"vertex", Some(_)) => match coordinates(words) {
                Ok(position) => corners.push(position),
                Err(_) if is_cut => break,
                Err(found) => return Err(malformed("three coordinates after \"vertex\"", found)),
            },
            (b"endfacet", Some(start)) => {
                triangle(&mut draft, corners.drain(..), start)?;
                facet = None;
            }
            _ if is_cut => break,
            _ => return Err(malformed("\"facet\", \"vertex\" or \"endfacet\"", excerpt(text))),
        }
    }
    if !is_ended {
        return Err(MeshError::Truncated {
            format: FORMAT,
            expected: "\"endsolid\"".to_owned(),
            found: format!("the end after {} triangles", draft.num_triangles()),
        });
    }
    draft.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{read, samples};

    #[test]
    fn a_binary_file_may_begin_with_solid() {
        let mut bytes = samples::stl_binary(&samples::cube());
        bytes[..10].copy_from_slice(b"solid cube");
        assert_eq!(read(&bytes).unwrap().triangles.len(), 12);
        bytes.extend_from_slice(b"\r\n");
        assert_eq!(read(&bytes).unwrap().triangles.len(), 12);
    }

    #[test]
    fn a_lying_count_allocates_nothing_and_is_named() {
        let mut bytes = samples::stl_binary(&samples::cube());
        bytes[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        let error = read(&bytes).unwrap_err();
        assert!(matches!(error, MeshError::Truncated { .. }), "{error}");
        assert!(error.to_string().contains("4294967295 triangles"), "{error}");
        bytes[80..84].copy_from_slice(&3_u32.to_le_bytes());
        let error = read(&bytes).unwrap_err();
        assert!(error.to_string().contains("bytes for 12"), "{error}");
        bytes[80..84].copy_from_slice(&0_u32.to_le_bytes());
        assert_eq!(read(&bytes[..84]), Err(MeshError::NoFaces { vertices: 0 }));
    }

    #[test]
    fn a_cut_file_is_named() {
        let bytes = samples::stl_binary(&samples::cube());
        assert!(matches!(read(&bytes[..300]), Err(MeshError::Truncated { .. })));
        let text = samples::stl_text(&samples::cube());
        for cut in [text.len() / 2, text.len() / 2 + 3, text.len() / 2 + 20, text.len() - 12] {
            let error = read(&text[..cut]).unwrap_err();
            assert!(matches!(error, MeshError::Truncated { .. }), "{cut}: {error}");
        }
    }

    #[test]
    fn text_may_shout_and_have_two_solids() {
        let text = samples::stl_text(&samples::cube()).to_ascii_uppercase();
        assert_eq!(read(&[&text[..], &text].concat()).unwrap().triangles.len(), 24);
    }

    #[test]
    fn a_wrong_line_is_named() {
        let text = String::from_utf8(samples::stl_text(&samples::cube())).unwrap();
        let wrong = text.replacen("vertex", "vertx", 1);
        let error = read(wrong.as_bytes()).unwrap_err();
        assert!(error.to_string().contains("line 4"), "{error}");
        let wrong = text.replacen("vertex 0", "vertex nan", 1);
        assert!(matches!(read(wrong.as_bytes()), Err(MeshError::NotFinite { .. })));
    }
}
