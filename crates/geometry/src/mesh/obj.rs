//! Wavefront OBJ: lines of `v x y z` and `f corner corner corner ...`.
//!
//! Normals, texture coordinates, groups and materials are skipped.

use super::read::{Draft, Lines, coordinates, excerpt, is_text, number, words};
use super::{Mesh, MeshError, Place};
use std::borrow::Cow;

const FORMAT: &str = "OBJ";

/// Whether one of the first lines is an OBJ vertex or face.
pub(super) fn is_obj(bytes: &[u8]) -> bool {
    let content = Lines::new(bytes).map(|(_, line)| line.trim_ascii());
    let mut content = content.filter(|line| !line.is_empty() && !line.starts_with(b"#"));
    is_text(bytes)
        && content.by_ref().take(200).any(|line| {
            let mut words = words(line);
            match (words.next(), words.next()) {
                (Some(b"v" | b"vn" | b"vt"), Some(word)) => number(word).is_some(),
                (Some(b"f"), Some(word)) => matches!(word[0], b'-' | b'0'..=b'9'),
                _ => false,
            }
        })
}

/// Reads the faces of all groups as one mesh.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut draft = Draft::new(FORMAT, 1);
    let mut corners = Vec::new();
    let mut all = Lines::new(bytes).peekable();
    while let Some((line, text)) = all.next() {
        let mut text = Cow::Borrowed(text);
        // A backslash continues a line on the next.
        while text.ends_with(b"\\")
            && let Some((_, tail)) = all.next()
        {
            let joined = text.to_mut();
            joined.pop();
            joined.push(b' ');
            joined.extend_from_slice(tail);
        }
        let is_cut = all.peek().is_none() && !bytes.ends_with(b"\n") && !bytes.ends_with(b"\r");
        let mut words = words(&text);
        let result = match words.next() {
            Some(b"v") => vertex(&mut draft, words, line),
            Some(b"f") => face(&mut draft, words, &mut corners, line),
            _ => Ok(()),
        };
        // The last line may be wrong because the file was cut there.
        result.map_err(|error| match error {
            MeshError::Malformed { expected, found, .. } if is_cut => {
                let expected = format!("{expected} in line {line}");
                MeshError::Truncated { format: FORMAT, expected, found }
            }
            error => error,
        })?;
    }
    draft.finish()
}

fn malformed(line: usize, expected: &'static str, found: String) -> MeshError {
    MeshError::Malformed { format: FORMAT, place: Place::Line(line), expected, found }
}

fn vertex<'a>(
    draft: &mut Draft,
    words: impl Iterator<Item = &'a [u8]>,
    line: usize,
) -> Result<(), MeshError> {
    let position = coordinates(words)
        .map_err(|found| malformed(line, "three coordinates after \"v\"", found))?;
    draft.vertex(position, Place::Line(line))
}

fn face<'a>(
    draft: &mut Draft,
    words: impl Iterator<Item = &'a [u8]>,
    corners: &mut Vec<u32>,
    line: usize,
) -> Result<(), MeshError> {
    corners.clear();
    for word in words.take_while(|word| !word.starts_with(b"#")) {
        // A corner is `vertex/texture/normal`; the last two may be missing.
        let index = word.split(|&b| b == b'/').next().unwrap_or(word);
        let index = std::str::from_utf8(index).ok().and_then(|text| text.parse::<i64>().ok());
        let Some(index) = index else {
            return Err(malformed(line, "a vertex index", excerpt(word)));
        };
        // Counted from 1, or backwards from the last vertex so far.
        let from_zero = if index < 0 { draft.num_vertices() as i64 + index } else { index - 1 };
        match u32::try_from(from_zero) {
            Ok(corner) => corners.push(corner),
            Err(_) => return Err(draft.bad_index(index, Place::Line(line))),
        }
    }
    draft.polygon(corners, Place::Line(line))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::read;

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    fn faces(text: &str) -> Result<Vec<[u32; 3]>, MeshError> {
        read(format!("{TRIANGLE}{text}").as_bytes()).map(|mesh| mesh.triangles)
    }

    #[test]
    fn corners_come_in_every_notation() {
        for face in ["f 1 2 3", "f 1/7 2/8 3/9", "f 1//1 2//1 3//1", "f 1/1/1 2/2/2 3/3/3 # end"] {
            assert_eq!(faces(face), Ok(vec![[0, 1, 2]]), "{face}");
        }
        assert_eq!(faces("f -3 -2 -1\r\n"), Ok(vec![[0, 1, 2]]));
        assert_eq!(faces("f 1 \\\n 2 \\\n 3\n"), Ok(vec![[0, 1, 2]]));
        assert_eq!(faces("v 1 1 0\nf 1 2 4 3\n"), Ok(vec![[0, 1, 3], [0, 3, 2]]));
        assert_eq!(faces("f 1 2 4\nv 9 9 9 1.0 0.5 0.5 0.5\n"), Ok(vec![[0, 1, 3]]));
    }

    #[test]
    fn a_bad_index_is_named_with_its_line() {
        for (face, index) in [("f 1 2 4\n", 4), ("f 0 1 2\n", 0), ("f -4 1 2\n", -4)] {
            let error = faces(face).unwrap_err();
            let limits = "there are vertices 1 to 3".to_owned();
            assert_eq!(error, MeshError::BadIndex { place: Place::Line(4), index, limits });
        }
        let early = read(b"f 1 2 3\n").unwrap_err();
        assert!(early.to_string().contains("there are no vertices"), "{early}");
    }

    #[test]
    fn a_coordinate_must_be_a_number() {
        for (word, is_number) in [("nan", true), ("-inf", true), ("1e30", true), ("x", false)] {
            let error = read(format!("v 0 0 0\nv 1 {word} 0\nf 1 2 1\n").as_bytes()).unwrap_err();
            assert_eq!(matches!(error, MeshError::NotFinite { .. }), is_number, "{error}");
            assert!(error.to_string().contains("line 2"), "{error}");
        }
    }

    #[test]
    fn a_cut_last_line_is_told_from_a_wrong_one() {
        assert!(matches!(faces("f 1 2"), Err(MeshError::Truncated { .. })));
        assert!(matches!(faces("f 1 2\n"), Err(MeshError::Malformed { .. })));
        assert_eq!(faces(""), Err(MeshError::NoFaces { vertices: 3 }));
    }
}
