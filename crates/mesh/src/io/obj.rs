//! Wavefront OBJ: lines of `v x y z` and `f corner corner corner ...`.
//!
//! Normals, texture coordinates, groups and materials are ignored.

use super::builder::MeshBuilder;
use super::parse::{LineReader, excerpt, is_text, parse_coordinates, parse_number, tokens};
use crate::{Location, Mesh, MeshError};
use std::borrow::Cow;

const FORMAT: &str = "OBJ";

/// Whether one of the first 200 content lines is an OBJ vertex or face.
pub(super) fn is_obj(bytes: &[u8]) -> bool {
    let content = LineReader::new(bytes).map(|(_, line)| line.trim_ascii());
    let mut content = content.filter(|line| !line.is_empty() && !line.starts_with(b"#"));
    is_text(bytes)
        && content.by_ref().take(200).any(|line| {
            let mut tokens = tokens(line);
            match (tokens.next(), tokens.next()) {
                (Some(b"v" | b"vn" | b"vt"), Some(token)) => parse_number(token).is_some(),
                (Some(b"f"), Some(token)) => matches!(token[0], b'-' | b'+' | b'0'..=b'9'),
                _ => false,
            }
        })
}

/// Parses the faces of all groups as one mesh.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut builder = MeshBuilder::new(FORMAT, 1);
    let mut corners = Vec::new();
    let mut lines = LineReader::new(bytes).peekable();
    while let Some((line, text)) = lines.next() {
        let mut text = Cow::Borrowed(text);
        // A backslash continues a line on the next.
        while let Some(head) = text.trim_ascii_end().strip_suffix(b"\\")
            && let Some((_, tail)) = lines.next()
        {
            let mut joined = head.to_vec();
            joined.push(b' ');
            joined.extend_from_slice(tail);
            text = Cow::Owned(joined);
        }
        let is_cut = lines.peek().is_none() && !bytes.ends_with(b"\n") && !bytes.ends_with(b"\r");
        let mut tokens = tokens(&text);
        let result = match tokens.next() {
            Some(b"v") => add_vertex(&mut builder, tokens, line),
            Some(b"f") => add_face(&mut builder, tokens, &mut corners, line),
            _ => Ok(()),
        };
        // An invalid last line without a line break indicates a truncated file.
        result.map_err(|error| match error {
            MeshError::Malformed { expected, found, .. } if is_cut => {
                let expected = format!("{expected} in line {line}");
                MeshError::Truncated { format: FORMAT, expected, found }
            }
            error => error,
        })?;
    }
    builder.finish()
}

fn malformed(line: usize, expected: &'static str, found: String) -> MeshError {
    MeshError::Malformed { format: FORMAT, location: Location::Line(line), expected, found }
}

fn add_vertex<'a>(
    builder: &mut MeshBuilder,
    tokens: impl Iterator<Item = &'a [u8]>,
    line: usize,
) -> Result<(), MeshError> {
    let position = parse_coordinates(tokens)
        .map_err(|found| malformed(line, "three coordinates after \"v\"", found))?;
    builder.add_vertex(position, Location::Line(line))
}

fn add_face<'a>(
    builder: &mut MeshBuilder,
    tokens: impl Iterator<Item = &'a [u8]>,
    corners: &mut Vec<u32>,
    line: usize,
) -> Result<(), MeshError> {
    corners.clear();
    for token in tokens.take_while(|token| !token.starts_with(b"#")) {
        // A corner is `vertex/texture/normal`; the last two are optional.
        let index = token.split(|&b| b == b'/').next().unwrap_or(token);
        let index = std::str::from_utf8(index).ok().and_then(|text| text.parse::<i64>().ok());
        let Some(index) = index else {
            return Err(malformed(line, "a vertex index", excerpt(token)));
        };
        // Counted from 1; negative indices count back from the last vertex so far.
        let from_zero = if index < 0 { builder.num_vertices() as i64 + index } else { index - 1 };
        match u32::try_from(from_zero) {
            Ok(corner) => corners.push(corner),
            Err(_) => return Err(builder.bad_index(index, Location::Line(line))),
        }
    }
    builder.add_polygon(corners, Location::Line(line))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read;

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    fn faces(text: &str) -> Result<Vec<[u32; 3]>, MeshError> {
        read(format!("{TRIANGLE}{text}").as_bytes()).map(|mesh| mesh.triangles)
    }

    #[test]
    fn all_corner_notations_are_read() {
        for face in ["f 1 2 3", "f 1/7 2/8 3/9", "f 1//1 2//1 3//1", "f 1/1/1 2/2/2 3/3/3 # end"] {
            assert_eq!(faces(face), Ok(vec![[0, 1, 2]]), "{face}");
        }
        assert_eq!(faces("f -3 -2 -1\r\n"), Ok(vec![[0, 1, 2]]));
        assert_eq!(faces("f 1 \\\n 2 \\\n 3\n"), Ok(vec![[0, 1, 2]]));
        assert_eq!(faces("f 1 \\ \r\n 2 \\\r\n 3\r\n"), Ok(vec![[0, 1, 2]]));
        assert_eq!(faces("v 1 1 0\nf 1 2 4 3\n"), Ok(vec![[0, 1, 3], [0, 3, 2]]));
        assert_eq!(faces("f 1 2 4\nv 9 9 9 1.0 0.5 0.5 0.5\n"), Ok(vec![[0, 1, 3]]));
    }

    #[test]
    fn invalid_index_is_reported_with_its_line() {
        for (face, index) in [("f 1 2 4\n", 4), ("f 0 1 2\n", 0), ("f -4 1 2\n", -4)] {
            let error = faces(face).unwrap_err();
            let limits = "there are vertices 1 to 3".to_owned();
            assert_eq!(error, MeshError::BadIndex { location: Location::Line(4), index, limits });
        }
        let early = read(b"f 1 2 3\n").unwrap_err();
        assert!(early.to_string().contains("there are no vertices"), "{early}");
    }

    #[test]
    fn invalid_coordinate_is_reported_with_its_line() {
        for (word, is_number) in [("nan", true), ("-inf", true), ("1e30", true), ("x", false)] {
            let error = read(format!("v 0 0 0\nv 1 {word} 0\nf 1 2 1\n").as_bytes()).unwrap_err();
            assert_eq!(matches!(error, MeshError::NotFinite { .. }), is_number, "{error}");
            assert!(error.to_string().contains("line 2"), "{error}");
        }
    }

    #[test]
    fn vertex_without_a_face_may_be_invalid() {
        let mesh = read(b"v nan nan nan\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 2 3 4\n").unwrap();
        assert_eq!(mesh.extent(), glamx::Vec3::new(1.0, 1.0, 0.0));
    }

    #[test]
    fn truncated_last_line_is_distinct_from_an_invalid_line() {
        assert!(matches!(faces("f 1 2"), Err(MeshError::Truncated { .. })));
        assert!(matches!(faces("f 1 2\n"), Err(MeshError::Malformed { .. })));
        assert_eq!(faces(""), Err(MeshError::NoFaces { vertices: 3 }));
    }
}
