//! Object File Format: the word OFF, the numbers of vertices and faces, a line of `x y z` for each vertex and one of
//! `n corner corner corner ...` for each face.
//!
//! Normals and colours are skipped. The many files whose counts stand in the line of the word are read, too.

use super::read::{Draft, Lines, coordinates, excerpt, is_text, words};
use super::{Mesh, MeshError, Place};

const FORMAT: &str = "OFF";

/// Whether the first line that is no comment begins with the word.
pub(super) fn is_off(bytes: &[u8]) -> bool {
    is_text(bytes) && content(bytes).next().is_some_and(|(_, line)| after_word(line).is_some())
}

/// Reads all faces as one mesh.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut draft = Draft::new(FORMAT, 0);
    let mut lines = content(bytes);
    let (first, line) = lines.next().unwrap_or_default();
    let rest = after_word(line).unwrap_or_default();
    let (at, counted) = match rest.is_empty() {
        true => lines.next().ok_or_else(|| cut("the numbers of vertices and faces", "nothing"))?,
        false => (first, rest),
    };
    let [vertices, faces] = counts(counted)
        .map_err(|found| malformed(at, "the numbers of vertices and faces", found))?;
    for read in 0..vertices {
        let promised = || cut(&format!("{vertices} vertices"), &read.to_string());
        let (at, line) = lines.next().ok_or_else(promised)?;
        let position =
            coordinates(words(line)).map_err(|found| malformed(at, "three coordinates", found))?;
        draft.vertex(position, Place::Line(at))?;
    }
    let mut corners = Vec::new();
    for read in 0..faces {
        let promised = || cut(&format!("{faces} faces"), &read.to_string());
        let (at, line) = lines.next().ok_or_else(promised)?;
        let mut numbers = words(line).map(|word| index(word).ok_or_else(|| excerpt(word)));
        let end = || malformed(at, "a vertex index", "the end of the line".into());
        let count = numbers.next().unwrap_or(Ok(0));
        let count = count.map_err(|found| malformed(at, "a number of corners", found))?;
        corners.clear();
        for _ in 0..count {
            let corner = numbers.next().ok_or_else(end)?;
            corners.push(corner.map_err(|found| malformed(at, "a vertex index", found))?);
        }
        draft.polygon(&corners, Place::Line(at))?;
    }
    draft.finish()
}

/// Lines with their numbers, without comments, blank ones left out.
fn content(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    Lines::new(bytes)
        .map(|(number, line)| (number, bare(line)))
        .filter(|(_, line)| !line.is_empty())
}

/// A line without its comment.
fn bare(line: &[u8]) -> &[u8] {
    let end = line.iter().position(|&b| b == b'#').unwrap_or(line.len());
    line[..end].trim_ascii()
}

/// What follows the word; C and N before it say that vertices have colours and normals.
fn after_word(line: &[u8]) -> Option<&[u8]> {
    let line = line.strip_prefix(b"C").unwrap_or(line);
    let line = line.strip_prefix(b"N").unwrap_or(line);
    let rest = line.strip_prefix(b"OFF")?;
    let is_word = rest.first().is_none_or(|b| b.is_ascii_whitespace() || b.is_ascii_digit());
    is_word.then(|| rest.trim_ascii())
}

/// The first two numbers of a line; if one is missing, what stands in its place.
fn counts(line: &[u8]) -> Result<[u32; 2], String> {
    let mut words = words(line);
    let mut next = || {
        let word = words.next().ok_or("the end of the line")?;
        index(word).ok_or_else(|| excerpt(word))
    };
    Ok([next()?, next()?])
}

fn index(word: &[u8]) -> Option<u32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

fn malformed(line: usize, expected: &'static str, found: String) -> MeshError {
    MeshError::Malformed { format: FORMAT, place: Place::Line(line), expected, found }
}

fn cut(expected: &str, found: &str) -> MeshError {
    MeshError::Truncated { format: FORMAT, expected: expected.into(), found: found.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::read;

    const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0 0.5 0.5 0.5\n\n0 1 0 # the last\n4 0 1 2 3 255 0 0\n";

    #[test]
    fn the_counts_stand_below_the_word_or_beside_it() {
        for head in
            ["OFF\n4 1 0\n", "OFF4 1 0\n", "# a square\r\nCOFF 4 1\n", "NOFF\n# counts\n4 1 4\n"]
        {
            let mesh = read(format!("{head}{SQUARE}").as_bytes()).unwrap();
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{head}");
            assert_eq!(mesh.vertices[2], crate::Vec3::new(1.0, 1.0, 0.0));
        }
        let found = "plain text";
        assert_eq!(read(b"OFFICE\n4 1 0\n"), Err(MeshError::NotAMesh { found }));
    }

    #[test]
    fn what_is_missing_or_wrong_is_named() {
        let error = |text: &str| read(text.as_bytes()).unwrap_err().to_string();
        for (text, said) in [
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
            assert!(error(text).contains(said), "{text:?}: {}", error(text));
        }
    }
}
