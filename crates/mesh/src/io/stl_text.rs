//! Text STL: `facet`, three `vertex x y z`, `endfacet`, in one or more solids.
//!
//! Keywords have no case and may be split (`end facet`). Unknown words, such as the colour of a facet, are
//! skipped. A complete facet at the end of the file needs no `endsolid`.

use super::builder::MeshBuilder;
use super::parse::{
    LineReader, excerpt, is_text as is_plain_text, numbered_tokens, parse_number, tokens,
};
use super::stl::{FORMAT, add_facet};
use crate::{Location, Mesh, MeshError};

/// Whether the first word is "solid".
pub(super) fn is_text(bytes: &[u8]) -> bool {
    let keyword = tokens(first_line(bytes)).next().unwrap_or_default();
    keyword.eq_ignore_ascii_case(b"solid") && is_plain_text(bytes)
}

/// First line that is not blank.
fn first_line(bytes: &[u8]) -> &[u8] {
    let mut lines = LineReader::new(bytes).map(|(_, line)| line.trim_ascii());
    lines.find(|line| !line.is_empty()).unwrap_or_default()
}

/// Facet under construction.
struct Facet {
    start: Location,
    corners: Vec<[f64; 3]>,
    /// First word that is not a keyword, with its line.
    unknown: Option<(usize, String)>,
}

/// Parses all solids as one mesh.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut builder = MeshBuilder::new(FORMAT, 0);
    let mut facet: Option<Facet> = None;
    let mut first_unknown = None;
    let has_lines = !first_line(bytes).windows(6).any(|w| w.eq_ignore_ascii_case(b"vertex"));
    let mut words = numbered_tokens(bytes).peekable();
    while let Some((line, word)) = words.next() {
        let mut keyword = word.to_ascii_lowercase();
        if keyword == b"end"
            && let Some((_, next)) = words.next()
        {
            keyword.extend(next.to_ascii_lowercase());
        }
        match (&keyword[..], &mut facet) {
            (b"outer" | b"loop" | b"endloop", _) => {}
            (b"vertex", Some(facet)) => {
                let coordinates = words.by_ref().take(3).map(|(_, word)| word);
                match coordinates.map(|word| parse_number(word).ok_or(word)).collect() {
                    Ok(numbers) => facet.corners.push(to_position(numbers, line)?),
                    // A truncated file ends in a number.
                    Err(_) if words.peek().is_none() => break,
                    Err(word) => {
                        return Err(malformed(line, "three coordinates after \"vertex\"", word));
                    }
                }
            }
            (b"facet", None) => {
                let (start, corners) = (Location::Line(line), Vec::new());
                facet = Some(Facet { start, corners, unknown: None });
                if words.next_if(|(_, next)| next.eq_ignore_ascii_case(b"normal")).is_some() {
                    skip_normal(&mut words);
                }
            }
            (b"endfacet", Some(_)) => {
                facet.take().map_or(Ok(()), |facet| facet.finish(&mut builder))?;
            }
            (b"solid", None) => skip_name(&mut words, line, has_lines),
            (keyword, None) if keyword.starts_with(b"endsolid") => {
                skip_name(&mut words, line, has_lines);
            }
            (_, Some(facet)) => {
                facet.unknown.get_or_insert_with(|| (line, excerpt(word)));
            }
            (_, None) => {
                first_unknown.get_or_insert((line, word));
            }
        }
    }
    if facet.is_some() {
        return Err(MeshError::Truncated {
            format: FORMAT,
            expected: "\"endfacet\"".to_owned(),
            found: format!("the end of the file after {} triangles", builder.num_triangles()),
        });
    }
    match first_unknown {
        Some((line, word)) if builder.num_triangles() == 0 => {
            Err(malformed(line, "\"facet\"", word))
        }
        _ => builder.finish(),
    }
}

fn malformed(line: usize, expected: &'static str, word: &[u8]) -> MeshError {
    let (location, found) = (Location::Line(line), excerpt(word));
    MeshError::Malformed { format: FORMAT, location, expected, found }
}

fn to_position(numbers: Vec<f64>, line: usize) -> Result<[f64; 3], MeshError> {
    numbers.try_into().map_err(|_| MeshError::Truncated {
        format: FORMAT,
        expected: format!("three coordinates in line {line}"),
        found: "the end of the file".to_owned(),
    })
}

/// Skips the three numbers of a normal, which exporters may leave out or write as `nan`.
fn skip_normal<'w>(words: &mut std::iter::Peekable<impl Iterator<Item = (usize, &'w [u8])>>) {
    for _ in 0..3 {
        let is_keyword = |word: &[u8]| {
            [&b"outer"[..], b"vertex", b"endfacet"].iter().any(|k| word.eq_ignore_ascii_case(k))
        };
        words.next_if(|(_, word)| !is_keyword(word));
    }
}

/// Skips the name of a solid: the rest of the line, or up to a facet or a solid in a file of one line.
fn skip_name<'w>(
    words: &mut std::iter::Peekable<impl Iterator<Item = (usize, &'w [u8])>>,
    line: usize,
    has_lines: bool,
) {
    let is_name = |&(at, word): &(usize, &[u8])| {
        let is_keyword = [&b"facet"[..], b"solid"].iter().any(|k| word.eq_ignore_ascii_case(k));
        at == line && (has_lines || !is_keyword)
    };
    while words.next_if(is_name).is_some() {}
}

impl Facet {
    fn finish(self, builder: &mut MeshBuilder) -> Result<(), MeshError> {
        match self.unknown {
            Some((line, found)) if self.corners.len() != 3 => Err(MeshError::Malformed {
                format: FORMAT,
                location: Location::Line(line),
                expected: "\"facet\", \"vertex\" or \"endfacet\"",
                found,
            }),
            _ => add_facet(builder, self.corners.into_iter(), self.start),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read;
    use crate::test_meshes;

    fn text() -> String {
        String::from_utf8(test_meshes::stl_text(&test_meshes::cube())).unwrap()
    }

    #[test]
    fn keywords_are_read_as_exporters_write_them() {
        let text = text();
        for (name, changed) in [
            ("glued name", text.replace("endsolid thing", "endsolidAssimpScene")),
            ("end solid", text.replace("endsolid", "end solid")),
            ("end loop", text.replace("endloop", "end loop")),
            ("end facet", text.replace("endfacet", "END FACET")),
            ("no endsolid", text.replace("endsolid thing\n", "")),
            ("a colour", text.replace("  outer loop", "  color 0.5 0.5 0.5\n  outer loop")),
            ("one line", text.replace('\n', " ")),
            ("no line break at the end", text.trim_end().to_owned()),
            ("a name of keywords", text.replace("thing", "my solid facet and end")),
            ("no normal", text.replace(" normal 0 0 0", "")),
            ("a normal of nan", text.replace("normal 0 0 0", "normal nan nan -nan(ind)")),
            ("decimal commas", text.replace("vertex 0 ", "vertex 0,0 ")),
        ] {
            let mesh = read(changed.as_bytes()).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(mesh.triangles.len(), 12, "{name}");
            assert_eq!(test_meshes::volume(&mesh), 1.0, "{name}");
        }
    }

    #[test]
    fn uppercase_text_with_two_solids_is_read() {
        let text = text().to_ascii_uppercase();
        assert_eq!(read(text.repeat(2).as_bytes()).unwrap().triangles.len(), 24);
        assert_eq!(read(text.replace('\n', " ").repeat(2).as_bytes()).unwrap().triangles.len(), 24);
    }

    #[test]
    fn truncated_file_is_reported() {
        let text = text();
        let end = text.rfind("endfacet").unwrap();
        for cut in [end - 60, end - 40, end - 20, end, end + 3] {
            let error = read(&text.as_bytes()[..cut]).unwrap_err();
            assert!(matches!(error, MeshError::Truncated { .. }), "{cut}: {error}");
        }
    }

    #[test]
    fn invalid_line_is_reported() {
        let error = read(text().replacen("vertex", "vertx", 1).as_bytes()).unwrap_err();
        assert!(error.to_string().contains("line 4"), "{error}");
        let error = read(text().replacen("vertex 0", "vertex x", 1).as_bytes()).unwrap_err();
        assert!(error.to_string().contains("line 4: expected three coordinates"), "{error}");
        let error = read(text().replacen("vertex 0", "vertex nan", 1).as_bytes()).unwrap_err();
        assert!(matches!(error, MeshError::NotFinite { .. }));
        let error = read(b"solid advice\nis rare\n").unwrap_err();
        assert!(error.to_string().contains("line 2: expected \"facet\""), "{error}");
    }
}
