//! STL: triangle soup, as text or in binary records of 50 bytes.

use super::parse::{
    LineReader, MeshBuilder, excerpt, is_text as is_plain_text, parse_coordinates, tokens,
};
use crate::{Location, Mesh, MeshError};

const FORMAT: &str = "STL";
/// Size of the binary header (bytes): 80 of free text, then the number of triangles.
const HEADER_BYTES: usize = 84;
/// Size of a record (bytes): normal, three corners, attribute.
const RECORD_BYTES: usize = 50;

/// Parser of the variant, binary or text; `None` if the bytes are not STL.
pub(super) fn detect(bytes: &[u8]) -> Option<super::Reader> {
    if is_binary(bytes) {
        return Some(read_binary);
    }
    is_text(bytes).then_some(read_text)
}

/// Whether the bytes are a text STL, complete or truncated.
fn is_text(bytes: &[u8]) -> bool {
    let first =
        LineReader::new(bytes).map(|(_, line)| line.trim_ascii()).find(|line| !line.is_empty());
    let keyword = first.and_then(|line| tokens(line).next()).unwrap_or_default();
    keyword.eq_ignore_ascii_case(b"solid") && is_plain_text(bytes)
}

/// Whether the bytes are a binary STL, complete or truncated; its header may begin with "solid".
///
/// The format has no magic number. A complete file has the length given by its count. No text file does:
/// four printable characters as a count exceed 100 million triangles. A truncated file begins with a
/// plausible record.
fn is_binary(bytes: &[u8]) -> bool {
    let Some(count) = triangle_count(bytes) else { return false };
    let is_complete =
        (count > 0 || bytes.len() == HEADER_BYTES) && surplus_bytes(bytes, count) == 0;
    let has_record = bytes.get(HEADER_BYTES..HEADER_BYTES + RECORD_BYTES).is_some_and(is_plausible);
    is_complete || (count > 0 && has_record && !is_plain_text(bytes))
}

/// Number of triangles declared in the header.
fn triangle_count(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?;
    Some(u32::from_le_bytes(count.try_into().ok()?))
}

/// Bytes after the last declared record, negative if bytes are missing; a final line break does not count.
fn surplus_bytes(bytes: &[u8], count: u32) -> i64 {
    let extra = bytes.len() as i64 - (HEADER_BYTES as i64 + i64::from(count) * RECORD_BYTES as i64);
    match extra {
        1 if bytes.ends_with(b"\n") => 0,
        2 if bytes.ends_with(b"\r\n") => 0,
        _ => extra,
    }
}

/// Whether a record has a normal of length 1 or 0, and coordinates below 1e9.
fn is_plausible(record: &[u8]) -> bool {
    let floats = record_floats(record);
    let length = floats[..3].iter().map(|x| x * x).sum::<f64>().sqrt();
    let is_normal = length == 0.0 || (0.9..1.1).contains(&length);
    is_normal && floats.iter().all(|x| x.abs() < 1e9)
}

fn record_floats(record: &[u8]) -> [f64; 12] {
    let mut floats = [0.0; 12];
    for (float, &bytes) in floats.iter_mut().zip(record.as_chunks::<4>().0) {
        *float = f64::from(f32::from_le_bytes(bytes));
    }
    floats
}

/// Parses a binary STL, after a check of the length against the header.
fn read_binary(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let count = triangle_count(bytes).unwrap_or(0);
    let extra = surplus_bytes(bytes, count);
    let (records, _) = bytes.get(HEADER_BYTES..).unwrap_or(&[]).as_chunks::<RECORD_BYTES>();
    if extra < 0 {
        return Err(MeshError::Truncated {
            format: FORMAT,
            expected: format!("{count} triangles (declared in the header)"),
            found: format!("{} in {} bytes", records.len(), bytes.len()),
        });
    }
    if extra > 0 {
        return Err(MeshError::Malformed {
            format: FORMAT,
            location: Location::Byte(HEADER_BYTES - 4),
            expected: "the number of triangles in the file",
            found: format!("{count}, but bytes for {}", records.len()),
        });
    }
    let mut builder = MeshBuilder::new(FORMAT, 0);
    for (i, record) in records.iter().enumerate() {
        let location = Location::Byte(HEADER_BYTES + i * RECORD_BYTES);
        let floats = record_floats(record);
        let (corners, _) = floats[3..].as_chunks::<3>();
        add_triangle(&mut builder, corners.iter().copied(), location)?;
    }
    builder.finish()
}

fn add_triangle(
    builder: &mut MeshBuilder,
    corners: impl Iterator<Item = [f64; 3]>,
    location: Location,
) -> Result<(), MeshError> {
    let first = builder.num_vertices() as u32;
    for corner in corners {
        builder.add_vertex(corner, location)?;
    }
    let corners: Vec<u32> = (first..builder.num_vertices() as u32).collect();
    builder.add_polygon(&corners, location)
}

/// Parses a text STL, all solids as one mesh; keywords are case-insensitive.
fn read_text(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut builder = MeshBuilder::new(FORMAT, 0);
    let mut corners: Vec<[f64; 3]> = Vec::new();
    let mut facet = None;
    let mut is_ended = false;
    let mut lines = LineReader::new(bytes).peekable();
    while let Some((line, text)) = lines.next() {
        // An invalid last line without a line break indicates a truncated file.
        let is_cut = lines.peek().is_none() && !bytes.ends_with(b"\n") && !is_ended;
        let location = Location::Line(line);
        let mut tokens = tokens(text);
        let keyword = tokens.next().unwrap_or_default().to_ascii_lowercase();
        let malformed =
            |expected, found| MeshError::Malformed { format: FORMAT, location, expected, found };
        match (&keyword[..], facet) {
            (b"" | b"outer" | b"endloop", _) => {}
            (b"solid", None) => is_ended = false,
            (b"endsolid", None) => is_ended = true,
            (b"facet", None) => facet = Some(location),
            (b"vertex", Some(_)) => match parse_coordinates(tokens) {
                Ok(position) => corners.push(position),
                Err(_) if is_cut => break,
                Err(found) => return Err(malformed("three coordinates after \"vertex\"", found)),
            },
            (b"endfacet", Some(start)) => {
                add_triangle(&mut builder, corners.drain(..), start)?;
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
            found: format!("the end of the file after {} triangles", builder.num_triangles()),
        });
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read;
    use crate::test_meshes;

    #[test]
    fn binary_file_that_begins_with_solid_is_read() {
        let mut bytes = test_meshes::stl_binary(&test_meshes::cube());
        bytes[..10].copy_from_slice(b"solid cube");
        assert_eq!(read(&bytes).unwrap().triangles.len(), 12);
        bytes.extend_from_slice(b"\r\n");
        assert_eq!(read(&bytes).unwrap().triangles.len(), 12);
    }

    #[test]
    fn wrong_count_is_reported_without_allocation() {
        let mut bytes = test_meshes::stl_binary(&test_meshes::cube());
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
    fn truncated_file_is_reported() {
        let bytes = test_meshes::stl_binary(&test_meshes::cube());
        assert!(matches!(read(&bytes[..300]), Err(MeshError::Truncated { .. })));
        let text = test_meshes::stl_text(&test_meshes::cube());
        for cut in [text.len() / 2, text.len() / 2 + 3, text.len() / 2 + 20, text.len() - 12] {
            let error = read(&text[..cut]).unwrap_err();
            assert!(matches!(error, MeshError::Truncated { .. }), "{cut}: {error}");
        }
    }

    #[test]
    fn uppercase_text_with_two_solids_is_read() {
        let text = test_meshes::stl_text(&test_meshes::cube()).to_ascii_uppercase();
        assert_eq!(read(&[&text[..], &text].concat()).unwrap().triangles.len(), 24);
    }

    #[test]
    fn invalid_line_is_reported() {
        let text = String::from_utf8(test_meshes::stl_text(&test_meshes::cube())).unwrap();
        let wrong = text.replacen("vertex", "vertx", 1);
        let error = read(wrong.as_bytes()).unwrap_err();
        assert!(error.to_string().contains("line 4"), "{error}");
        let wrong = text.replacen("vertex 0", "vertex nan", 1);
        assert!(matches!(read(wrong.as_bytes()), Err(MeshError::NotFinite { .. })));
    }
}
