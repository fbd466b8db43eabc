//! Object File Format: the keyword OFF, the numbers of vertices and faces, `x y z` for each vertex, and
//! `n corner corner corner ...` for each face.
//!
//! Normals, colours and texture coordinates are ignored. Each vertex and face usually has a line of its own
//! and may end with further numbers. Without such lines, the prefixes of the keyword give the length of a
//! vertex.

use super::builder::MeshBuilder;
use super::parse::{LineReader, excerpt, is_text, parse_coordinates, parse_number, tokens};
use crate::{Location, Mesh, MeshError};

const FORMAT: &str = "OFF";

/// Whether the first content line begins with the keyword.
pub(super) fn is_off(bytes: &[u8]) -> bool {
    is_binary(bytes)
        || is_text(bytes)
            && content_lines(bytes).next().is_some_and(|(_, line)| parse_keyword(line).is_some())
}

fn is_binary(bytes: &[u8]) -> bool {
    let line = LineReader::new(bytes).next().map_or(&[][..], |(_, line)| line);
    let Some((_, rest)) = parse_keyword(line) else { return false };
    tokens(rest).next().is_some_and(|word| word.eq_ignore_ascii_case(b"binary"))
}

/// Parses all faces as one mesh.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    if is_binary(bytes) {
        let feature = "the binary encoding".to_owned();
        return Err(MeshError::Unsupported { format: FORMAT, feature });
    }
    let mut lines = content_lines(bytes);
    let (first, line) = lines.next().unwrap_or_default();
    let (keyword, rest) = parse_keyword(line).unwrap_or_default();
    let (line_number, counts_text) = match rest.is_empty() {
        true => {
            lines.next().ok_or_else(|| truncated("the numbers of vertices and faces", "nothing"))?
        }
        false => (first, rest),
    };
    let counts = parse_counts(counts_text)
        .map_err(|found| malformed(line_number, "the numbers of vertices and faces", found))?;
    // The counts may be followed by the number of edges, and by vertices if the file has few lines.
    let has_lines = tokens(counts_text).nth(3).is_none();
    if has_lines {
        read_lines(lines, counts)
    } else {
        let extra = keyword.values_per_vertex - 3;
        let rest = lines.flat_map(|(line, text)| tokens(text).map(move |word| (line, word)));
        let words = tokens(counts_text).map(|word| (line_number, word)).chain(rest);
        read_tokens(words.skip(3), counts, extra)
    }
}

/// Reads vertices and faces that have a line each.
fn read_lines<'a>(
    mut lines: impl Iterator<Item = (usize, &'a [u8])>,
    [vertices, faces]: [u32; 2],
) -> Result<Mesh, MeshError> {
    let mut builder = MeshBuilder::new(FORMAT, 0);
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
        let mut indices = tokens(line).map(|token| parse_index(token).ok_or(token));
        let end = || malformed(number, "a vertex index", "the end of the line".into());
        let count = indices.next().unwrap_or(Ok(0));
        let count =
            count.map_err(|found| malformed(number, "a number of corners", excerpt(found)))?;
        corners.clear();
        for _ in 0..count {
            let corner = indices.next().ok_or_else(end)?;
            let corner =
                corner.map_err(|found| malformed(number, "a vertex index", excerpt(found)))?;
            corners.push(corner);
        }
        builder.add_polygon(&corners, Location::Line(number))?;
    }
    builder.finish()
}

/// Reads vertices and faces from a stream of numbers; each vertex has `extra` numbers after its coordinates.
fn read_tokens<'a>(
    mut words: impl Iterator<Item = (usize, &'a [u8])>,
    [vertices, faces]: [u32; 2],
    extra: usize,
) -> Result<Mesh, MeshError> {
    let mut builder = MeshBuilder::new(FORMAT, 0);
    let mut number = |expected: &str| {
        let (line, word) = words.next().ok_or_else(|| truncated(expected, "fewer numbers"))?;
        let number = parse_number(word).ok_or_else(|| malformed(line, "a number", excerpt(word)));
        Ok::<_, MeshError>((line, number?))
    };
    let expected = format!("{vertices} vertices and {faces} faces");
    for _ in 0..vertices {
        let (line, x) = number(&expected)?;
        let position = [x, number(&expected)?.1, number(&expected)?.1];
        for _ in 0..extra {
            number(&expected)?;
        }
        builder.add_vertex(position, Location::Line(line))?;
    }
    let mut corners = Vec::new();
    for _ in 0..faces {
        let (line, count) = number(&expected)?;
        corners.clear();
        for _ in 0..count as u32 {
            let (line, index) = number(&expected)?;
            if f64::from(index as u32) != index {
                return Err(malformed(line, "a vertex index", index.to_string()));
            }
            corners.push(index as u32);
        }
        builder.add_polygon(&corners, Location::Line(line))?;
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

/// Keyword of the first line.
#[derive(Clone, Copy)]
struct Keyword {
    /// Numbers of a vertex: its coordinates, and what the prefixes ST, C and N declare.
    values_per_vertex: usize,
}

impl Default for Keyword {
    fn default() -> Self {
        Self { values_per_vertex: 3 }
    }
}

/// Keyword, in any case, and the rest of its line; the prefixes ST, C and N declare texture coordinates,
/// colours and normals of the vertices.
fn parse_keyword(line: &[u8]) -> Option<(Keyword, &[u8])> {
    let mut keyword = Keyword::default();
    let mut rest = line;
    for (prefix, values) in [(&b"ST"[..], 2), (b"C", 4), (b"N", 3)] {
        if let Some(tail) = strip_ignoring_case(rest, prefix) {
            keyword.values_per_vertex += values;
            rest = tail;
        }
    }
    let rest = strip_ignoring_case(rest, b"OFF")?;
    let is_keyword = rest.first().is_none_or(|b| b.is_ascii_whitespace() || b.is_ascii_digit());
    is_keyword.then(|| (keyword, rest.trim_ascii()))
}

fn strip_ignoring_case<'a>(bytes: &'a [u8], prefix: &[u8]) -> Option<&'a [u8]> {
    let (head, tail) = bytes.split_at_checked(prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then_some(tail)
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
        for head in [
            "OFF\n4 1 0\n",
            "OFF4 1 0\n",
            "off\n4 1 0\n",
            "STOFF\n4 1 0\n",
            "# a square\r\nCOFF 4 1\n",
            "NOFF\n# counts\n4 1 4\n",
        ] {
            let mesh = read(format!("{head}{SQUARE}").as_bytes()).unwrap();
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{head}");
            assert_eq!(mesh.vertices[2], glamx::Vec3::new(1.0, 1.0, 0.0));
        }
        let found = "plain text";
        assert_eq!(read(b"OFFICE\n4 1 0\n"), Err(MeshError::UnknownFormat { found }));
    }

    #[test]
    fn numbers_in_one_line_are_read() {
        for text in [
            "OFF 4 1 0 0 0 0 1 0 0 1 1 0 0 1 0 4 0 1 2 3",
            "OFF\n4 1 0 0 0 0 1 0 0\n1 1 0 0 1 0 4 0 1 2 3\n",
            "stoff 4 1 0 0 0 0 9 9 1 0 0 9 9 1 1 0 9 9 0 1 0 9 9 4 0 1 2 3\n",
            "NOFF 4 1 0 0 0 0 0 0 1 1 0 0 0 0 1 1 1 0 0 0 1 0 1 0 0 0 1 4 0 1 2 3",
        ] {
            let mesh = read(text.as_bytes()).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{text}");
            assert_eq!(mesh.extent(), glamx::Vec3::new(1.0, 1.0, 0.0), "{text}");
        }
        let error = read(b"OFF 4 1 0 0 0 0 1 0 0 1 1 0 0 1 0 4 0 1 2").unwrap_err();
        assert!(error.to_string().contains("expected 4 vertices and 1 faces"), "{error}");
    }

    #[test]
    fn missing_or_invalid_content_is_named() {
        let error = |text: &str| read(text.as_bytes()).unwrap_err().to_string();
        for (text, wanted) in [
            ("OFF BINARY\n", "the OFF file uses the binary encoding"),
            ("OFF\n", "expected the numbers of vertices and faces, found nothing"),
            ("OFF\nx 1 0\n", "line 2: expected the numbers of vertices and faces, found \"x\""),
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
