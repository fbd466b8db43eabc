//! Binary STL: 80 bytes of free text, the number of triangles, and a record of 50 bytes for each.

use super::builder::MeshBuilder;
use super::parse::is_text;
use super::stl::{FORMAT, add_facet};
use crate::{Location, Mesh, MeshError};
use glamx::DVec3;

/// Size of the header (bytes): free text, then the number of triangles.
const HEADER_BYTES: usize = 84;
/// Size of a record (bytes): normal, three corners, attribute.
const RECORD_BYTES: usize = 50;
/// Number of records that identify the format without a unit normal.
const MIN_PLAUSIBLE_RECORDS: usize = 4;

/// Whether the length is that given by the count in the header.
///
/// No text file has such a length: four printable characters as a count exceed 100 million triangles. The
/// header may begin with "solid", `{` or `<`.
pub(super) fn is_complete(bytes: &[u8]) -> bool {
    triangle_count(bytes).is_some_and(|count| count > 0 && surplus_bytes(bytes, count) == 0)
}

/// Whether the bytes are a binary STL: complete, truncated, or with other bytes behind the triangles.
///
/// The format has no magic number, so that a file of another length must begin with a plausible record.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    let is_empty = triangle_count(bytes) == Some(0) && bytes.len() == HEADER_BYTES;
    let all = records(bytes);
    let has_normal = all.first().is_some_and(|record| is_plausible(record) && is_normal(record));
    let start = all.get(..MIN_PLAUSIBLE_RECORDS);
    let has_records = has_normal || start.is_some_and(|start| start.iter().all(is_plausible));
    is_complete(bytes) || is_empty || (has_records && !is_text(bytes))
}

/// Number of triangles declared in the header.
fn triangle_count(bytes: &[u8]) -> Option<u32> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?;
    Some(u32::from_le_bytes(count.try_into().ok()?))
}

fn records(bytes: &[u8]) -> &[[u8; RECORD_BYTES]] {
    bytes.get(HEADER_BYTES..).unwrap_or(&[]).as_chunks::<RECORD_BYTES>().0
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

/// Whether a record has coordinates of a magnitude that meshes have.
fn is_plausible(record: &[u8; RECORD_BYTES]) -> bool {
    let is_coordinate = |x: &f64| *x == 0.0 || (1e-20..1e9).contains(&x.abs());
    floats(record)[3..].iter().all(is_coordinate)
}

/// Whether the normal of a record has the length 1 or 0.
fn is_normal(record: &[u8; RECORD_BYTES]) -> bool {
    let length = floats(record)[..3].iter().map(|x| x * x).sum::<f64>().sqrt();
    length == 0.0 || (0.9..1.1).contains(&length)
}

/// Whether a record is a triangle; padding and metadata are not.
fn is_triangle(record: &[u8; RECORD_BYTES]) -> bool {
    let floats = floats(record);
    let [a, b, c] = [3, 6, 9].map(|i| DVec3::new(floats[i], floats[i + 1], floats[i + 2]));
    is_plausible(record) && is_normal(record) && (b - a).cross(c - a).length() > 0.0
}

fn floats(record: &[u8; RECORD_BYTES]) -> [f64; 12] {
    let mut floats = [0.0; 12];
    for (float, &bytes) in floats.iter_mut().zip(record.as_chunks::<4>().0) {
        *float = f64::from(f32::from_le_bytes(bytes));
    }
    floats
}

/// Parses the declared triangles, after a check of the length against the header.
///
/// Bytes behind them are ignored, unless they are another STL or further triangles: then the count is wrong.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut builder = MeshBuilder::new(FORMAT, 0);
    builder.set_single_precision();
    let mut start = 0;
    loop {
        start += read_solid(&bytes[start..], start, &mut builder)?;
        if !is_joined(&bytes[start..]) {
            return builder.finish();
        }
    }
}

/// Whether the bytes behind a solid are a second file that was appended to the first.
fn is_joined(bytes: &[u8]) -> bool {
    triangle_count(bytes) > Some(0) && records(bytes).first().is_some_and(is_triangle)
}

/// Adds the triangles of the solid that begins at byte `start` of the file, and returns its length (bytes).
fn read_solid(bytes: &[u8], start: usize, builder: &mut MeshBuilder) -> Result<usize, MeshError> {
    let count = triangle_count(bytes).unwrap_or(0);
    let extra = surplus_bytes(bytes, count);
    let records = records(bytes);
    if extra < 0 {
        return Err(MeshError::Truncated {
            format: FORMAT,
            expected: format!("{count} triangles (declared in the header)"),
            found: format!("{} in {} bytes", records.len(), bytes.len()),
        });
    }
    let (declared, rest) = records.split_at(count as usize);
    if rest.first().is_some_and(is_triangle) {
        return Err(MeshError::Malformed {
            format: FORMAT,
            location: Location::Byte(start + HEADER_BYTES - 4),
            expected: "the number of triangles in the file",
            found: format!("{count}, but bytes for {}", records.len()),
        });
    }
    for (i, record) in declared.iter().enumerate() {
        let location = Location::Byte(start + HEADER_BYTES + i * RECORD_BYTES);
        let floats = floats(record);
        let (corners, _) = floats[3..].as_chunks::<3>();
        add_facet(builder, corners.iter().copied(), location)?;
    }
    Ok(HEADER_BYTES.min(bytes.len()) + declared.len() * RECORD_BYTES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read;
    use crate::test_meshes;

    #[test]
    fn header_that_begins_like_another_format_is_read() {
        for header in ["solid cube", "[mm] part 42", "{\"units\":\"mm\"}", "<exported by a tool>"] {
            let mut bytes = test_meshes::stl_binary(&test_meshes::cube());
            bytes[..header.len()].copy_from_slice(header.as_bytes());
            assert_eq!(read(&bytes).unwrap().triangles.len(), 12, "{header}");
            bytes.extend_from_slice(b"\r\n");
            assert_eq!(read(&bytes).unwrap().triangles.len(), 12, "{header}");
        }
    }

    #[test]
    fn bytes_behind_the_triangles_are_ignored() {
        for tail in [&[0, 0][..], b"<metadata>made by a scanner</metadata>", &[0; 340]] {
            let mut bytes = test_meshes::stl_binary(&test_meshes::cube());
            bytes[..80].fill(0);
            bytes.extend_from_slice(tail);
            assert_eq!(read(&bytes).unwrap().triangles.len(), 12, "{} bytes", tail.len());
        }
    }

    #[test]
    fn joined_files_are_read_as_one_mesh() {
        let first = test_meshes::stl_binary(&test_meshes::cube());
        let shifted = test_meshes::cube().translated(glamx::Vec3::X * 2.0);
        let second = test_meshes::stl_binary(&shifted);
        let joined = read(&[&first[..], &second].concat()).unwrap();
        assert_eq!(joined.triangles.len(), 24);
        assert_eq!(joined.extent(), glamx::Vec3::new(3.0, 1.0, 1.0));
        let three = read(&[&first[..], &second, &first].concat()).unwrap();
        assert_eq!(three.triangles.len(), 36);
        let error = read(&[&first[..], &second[..200]].concat()).unwrap_err();
        assert!(matches!(error, MeshError::Truncated { .. }), "{error}");
    }

    #[test]
    fn triangles_without_unit_normals_are_read_despite_trailing_bytes() {
        let mut bytes = test_meshes::stl_binary(&test_meshes::cube());
        for record in 0..12 {
            bytes[84 + 50 * record..][..4].copy_from_slice(&7.5_f32.to_le_bytes());
        }
        bytes.extend_from_slice(&[0; 3]);
        assert_eq!(read(&bytes).unwrap().triangles.len(), 12);
    }

    #[test]
    fn wrong_count_is_reported_without_allocation() {
        let mut bytes = test_meshes::stl_binary(&test_meshes::cube());
        bytes[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        let error = read(&bytes).unwrap_err();
        assert!(matches!(error, MeshError::Truncated { .. }), "{error}");
        assert!(error.to_string().contains("4294967295 triangles"), "{error}");
        for count in [3_u32, 0] {
            bytes[80..84].copy_from_slice(&count.to_le_bytes());
            let error = read(&bytes).unwrap_err().to_string();
            assert!(error.contains(&format!("found {count}, but bytes for 12")), "{error}");
        }
        assert_eq!(read(&bytes[..84]), Err(MeshError::NoFaces { vertices: 0 }));
    }

    #[test]
    fn truncated_file_is_reported() {
        let bytes = test_meshes::stl_binary(&test_meshes::cube());
        assert!(matches!(read(&bytes[..300]), Err(MeshError::Truncated { .. })));
    }

    #[test]
    fn coordinates_that_lost_their_digits_are_reported() {
        let far = test_meshes::cube().scaled(0.1).translated(glamx::Vec3::X * 10_000.0);
        let error = read(&test_meshes::stl_binary(&far)).unwrap_err();
        assert!(matches!(error, MeshError::Imprecise { .. }), "{error}");
        let near = test_meshes::cube().translated(glamx::Vec3::X * 1000.0);
        assert_eq!(read(&test_meshes::stl_binary(&near)).unwrap().extent(), glamx::Vec3::ONE);
    }
}
