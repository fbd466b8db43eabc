//! Object File Format: the keyword OFF, the numbers of vertices and faces, a line `x y z` for each vertex,
//! and a line `n corner corner corner ...` for each face.
//!
//! Normals and colours are ignored. The counts may follow the keyword on its line, as in many files.

use super::parse::{LineReader, MeshBuilder, excerpt, is_text, parse_coordinates, tokens};
use crate::{Location, Mesh, MeshError};

const FORMAT: &str = "OFF";

/// Whether the first content line begins with the keyword.
pub(super) fn is_off(bytes: &[u8]) -> bool {
    is_text(bytes)
        && content_lines(bytes).next().is_some_and(|(_, line)| after_keyword(line).is_some())
}

/// Parses all faces as one mesh.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut builder = MeshBuilder::new(FORMAT, 0);
    let mut lines = content_lines(bytes);
    let (first, line) = lines.next().unwrap_or_default();
    let rest = after_keyword(line).unwrap_or_default();
    let (line_number, counts_text) = match rest.is_empty() {
        true => {
            lines.next().ok_or_else(|| truncated("the numbers of vertices and faces", "nothing"))?
        }
        false => (first, rest),
    };
    let [vertices, faces] = parse_counts(counts_text)
        .map_err(|found| malformed(line_number, "the numbers of vertices and faces", found))?;
    for num_read in 0..vertices {
        let missing = || truncated(&format!("{vertices} vertices"), &num_read.to_string());
        let (number, line) = lines.next().ok_or_else(missing)?;
        let position = parse_coordinates(tokens(line))
            .map_err(|found| malformed(number, "three coordinates", found))?;
        builder.add_vertex(position, Location::Line(number))?;
    }
    let mut corners = Vec::new();
    for num_read in 0..faces {
        let missing = || truncated(&format!("{faces} faces"), &num_read.to_string());
        let (number, line) = lines.next().ok_or_else(missing)?;
        let mut indices =
            tokens(line).map(|token| parse_index(token).ok_or_else(|| excerpt(token)));
        let end = || malformed(number, "a vertex index", "the end of the line".into());
        let count = indices.next().unwrap_or(Ok(0));
        let count = count.map_err(|found| malformed(number, "a number of corners", found))?;
        corners.clear();
        for _ in 0..count {
            let corner = indices.next().ok_or_else(end)?;
            corners.push(corner.map_err(|found| malformed(number, "a vertex index", found))?);
        }
        builder.add_polygon(&corners, Location::Line(number))?;
    }
    builder.finish()
}

/// Lines with their numbers, without comments and blank lines.
fn content_lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    LineReader::new(bytes)
        .map(|(number, line)| (number, strip_comment(line)))
        .filter(|(_, line)| !line.is_empty())
}

/// A line without its comment.
fn strip_comment(line: &[u8]) -> &[u8] {
    let end = line.iter().position(|&b| b == b'#').unwrap_or(line.len());
    line[..end].trim_ascii()
}

/// Rest of the line after the keyword; the prefixes C and N declare vertex colours and normals.
fn after_keyword(line: &[u8]) -> Option<&[u8]> {
    let line = line.strip_prefix(b"C").unwrap_or(line);
    let line = line.strip_prefix(b"N").unwrap_or(line);
    let rest = line.strip_prefix(b"OFF")?;
    let is_keyword = rest.first().is_none_or(|b| b.is_ascii_whitespace() || b.is_ascii_digit());
    is_keyword.then(|| rest.trim_ascii())
}

/// Parses the first two tokens as counts.
///
/// The error is the invalid token, quoted, or "the end of the line".
fn parse_counts(line: &[u8]) -> Result<[u32; 2], String> {
    let mut tokens = tokens(line);
    let mut next = || {
        let token = tokens.next().ok_or("the end of the line")?;
        parse_index(token).ok_or_else(|| excerpt(token))
    };
    Ok([next()?, next()?])
}

fn parse_index(token: &[u8]) -> Option<u32> {
    std::str::from_utf8(token).ok()?.parse().ok()
}

fn malformed(line: usize, expected: &'static str, found: String) -> MeshError {
    MeshError::Malformed { format: FORMAT, location: Location::Line(line), expected, found }
}

fn truncated(expected: &str, found: &str) -> MeshError {
    MeshError::Truncated { format: FORMAT, expected: expected.into(), found: found.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read;

    const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0 0.5 0.5 0.5\n\n0 1 0 # the last\n4 0 1 2 3 255 0 0\n";

    #[test]
    fn counts_are_read_below_or_after_the_keyword() {
        for head in
            ["OFF\n4 1 0\n", "OFF4 1 0\n", "# a square\r\nCOFF 4 1\n", "NOFF\n# counts\n4 1 4\n"]
        {
            let mesh = read(format!("{head}{SQUARE}").as_bytes()).unwrap();
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{head}");
            assert_eq!(mesh.vertices[2], glamx::Vec3::new(1.0, 1.0, 0.0));
        }
        let found = "plain text";
        assert_eq!(read(b"OFFICE\n4 1 0\n"), Err(MeshError::UnknownFormat { found }));
    }

    #[test]
    fn missing_or_invalid_content_is_named() {
        let error = |text: &str| read(text.as_bytes()).unwrap_err().to_string();
        for (text, wanted) in [
            (
                "OFF BINARY\n",
                "line 1: expected the numbers of vertices and faces, found \"BINARY\"",
            ),
            ("OFF\n", "expected the numbers of vertices and faces, found nothing"),
            ("OFF\n3 1 0\n0 0 0\n1 0 0\n", "expected 3 vertices, found 2"),
            (
                "OFF\n3 1 0\n0 0 0\n1 0 0\n1 x 0\n",
                "line 5: expected three coordinates, found \"x\"",
            ),
            ("OFF\n3 2 0\n0 0 0\n1 0 0\n1 1 0\n3 0 1 2\n", "expected 2 faces, found 1"),
            ("OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 0\n3 0 1\n", "line 6: expected a vertex index"),
            ("OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 0\n3 0 1 3\n", "there are vertices 0 to 2"),
            ("OFF\n3 0 0\n0 0 0\n1 0 0\n1 1 0\n", "face"),
        ] {
            assert!(error(text).contains(wanted), "{text:?}: {}", error(text));
        }
    }
}
