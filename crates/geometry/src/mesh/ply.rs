//! PLY: a header in text that declares elements with properties, then their rows as text or binary.
//!
//! Only `x`, `y`, `z` of `vertex` and the corner list of `face` are kept.

use super::ply_header::{Element, Encoding, Role, Type, header};
use super::read::{Draft, Lines, MAX_VERTICES, excerpt, number};
use super::{Mesh, MeshError, Place};

pub(super) const FORMAT: &str = "PLY";

/// Reads the faces; the counts of the header are checked against the size of the file first.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut lines = Lines::new(bytes);
    let (encoding, elements, line) = header(&mut lines)?;
    let start = bytes.len() - lines.rest.len();
    let mut body = Body { bytes, at: start, line, encoding };
    let mut draft = Draft::new(FORMAT, 0);
    let mut corners = Vec::new();
    if !elements.iter().any(|e| e.name == "face") && elements.iter().any(|e| e.name == "tristrips")
    {
        return Err(MeshError::Unsupported {
            format: FORMAT,
            feature: "triangle strips".to_owned(),
        });
    }
    for element in &elements {
        element.check(&body)?;
        // An element without properties has no bytes, however many its header claims.
        let count = if element.properties.is_empty() { 0 } else { element.count };
        for row in 0..count {
            body.skip_space();
            let place = body.place();
            let (position, list) =
                body.row(element).map_err(|problem| element.error(problem, row, body.place()))?;
            if element.name == "vertex" {
                draft.vertex(position, place)?;
            } else if element.name == "face" {
                corners.clear();
                for index in list {
                    let corner = index as u32;
                    if f64::from(corner) != index {
                        return Err(draft.bad_index(index as i64, place));
                    }
                    corners.push(corner);
                }
                draft.polygon(&corners, place)?;
            }
        }
    }
    draft.finish()
}

/// Why a value could not be read.
enum Problem {
    End,
    Found(String),
}

impl Element {
    /// Checks that the element can be what the header says, before anything is read.
    fn check(&self, body: &Body<'_>) -> Result<(), MeshError> {
        let has = |role| self.properties.iter().any(|p| p.role == role);
        let expected = match &self.name[..] {
            "vertex" if !(0..3).all(|axis| has(Role::Coordinate(axis))) => "properties x, y and z",
            "face" if !has(Role::Corners) => "a list property vertex_indices",
            _ => {
                // A number in text takes a digit and a space, but for the very last one.
                let sizes = self.properties.iter().map(|p| match body.encoding {
                    Encoding::Text => 2,
                    _ => p.length.unwrap_or(p.value).size() as u64,
                });
                let row = sizes.sum::<u64>().max(1);
                let room = ((body.bytes.len() - body.at) as u64 + 1) / row;
                if self.count > room && !self.properties.is_empty() {
                    return Err(self.truncated(format!("bytes for at most {room}")));
                }
                return Ok(());
            }
        };
        let (place, found) = (Place::Line(self.line), format!("element {} without", self.name));
        Err(MeshError::Malformed { format: FORMAT, place, expected, found })
    }

    fn truncated(&self, found: String) -> MeshError {
        let expected = format!("{} rows of {}, as its header says", self.count, self.name);
        MeshError::Truncated { format: FORMAT, expected, found }
    }

    fn error(&self, problem: Problem, row: u64, place: Place) -> MeshError {
        match problem {
            Problem::End => self.truncated(row.to_string()),
            Problem::Found(found) => {
                MeshError::Malformed { format: FORMAT, place, expected: "a number", found }
            }
        }
    }
}

/// What follows the header, and how far it has been read.
struct Body<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    encoding: Encoding,
}

impl Body<'_> {
    fn place(&self) -> Place {
        match self.encoding {
            Encoding::Text => Place::Line(self.line),
            _ => Place::Byte(self.at),
        }
    }

    /// The coordinates and the corner list of the next row, as far as it has them.
    fn row(&mut self, element: &Element) -> Result<([f64; 3], Vec<f64>), Problem> {
        let mut position = [0.0; 3];
        let mut corners = Vec::new();
        for property in &element.properties {
            let Some(length) = property.length else {
                let value = self.value(property.value)?;
                if let Role::Coordinate(axis) = property.role {
                    position[axis] = value;
                }
                continue;
            };
            let length = self.value(length)?;
            if !(0.0..=f64::from(u32::MAX)).contains(&length) {
                return Err(Problem::Found(format!("a list of length {length}")));
            }
            for _ in 0..length as u32 {
                let value = self.value(property.value)?;
                // A longer face is refused later; it need not fill the memory first.
                if property.role == Role::Corners && corners.len() < MAX_VERTICES {
                    corners.push(value);
                }
            }
        }
        Ok((position, corners))
    }

    fn value(&mut self, kind: Type) -> Result<f64, Problem> {
        let rest = match self.encoding {
            Encoding::Text => {
                self.skip_space();
                &self.bytes[self.at..]
            }
            _ => &self.bytes[self.at..],
        };
        if self.encoding == Encoding::Text {
            let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
            if end == 0 {
                return Err(Problem::End);
            }
            self.at += end;
            return number(&rest[..end]).ok_or_else(|| Problem::Found(excerpt(&rest[..end])));
        }
        let size = kind.size();
        let bytes = rest.get(..size).ok_or(Problem::End)?;
        self.at += size;
        let mut raw = [0; 8];
        raw[..size].copy_from_slice(bytes);
        if self.encoding == Encoding::BigEndian {
            raw[..size].reverse();
        }
        Ok(kind.decode(raw))
    }

    /// In text, goes to the next word and counts lines.
    fn skip_space(&mut self) {
        while self.encoding == Encoding::Text
            && let Some(byte) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace())
        {
            let is_end =
                *byte == b'\n' || (*byte == b'\r' && self.bytes.get(self.at + 1) != Some(&b'\n'));
            self.line += usize::from(is_end);
            self.at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{read, samples};

    const HEAD: &str = "ply\nformat ascii 1.0\ncomment caf\u{e9}\nelement vertex 3\nproperty float x\n\
        property float y\nproperty float z\nproperty uchar red\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n";

    fn text(rows: &str) -> Result<Mesh, MeshError> {
        read(format!("{HEAD}{rows}").as_bytes())
    }

    #[test]
    fn both_byte_orders_give_the_same_mesh() {
        let cube = samples::cube();
        for is_big in [false, true] {
            assert_eq!(read(&samples::ply_binary(&cube, is_big)), Ok(cube.clone()));
        }
        assert_eq!(read(&samples::ply_text(&cube)), Ok(cube));
    }

    #[test]
    fn text_errors_name_their_line() {
        let mesh = text("0 0 0 255\n1. 0 0 255\n0 1e0 0 255\n3 0 1 2\n").unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
        for (rows, line) in [
            ("0 0 0 255\n1 x 0 255\n0 1 0 255\n3 0 1 2\n", "line 13: expected a number"),
            ("0 0 0 255\n1 nan 0 255\n0 1 0 255\n3 0 1 2\n", "line 13: a coordinate is NaN"),
            ("0 0 0 255\n1 0 0 255\n0 1 0 255\n3 0 1 3\n", "line 15: a face uses vertex 3"),
            ("0 0 0 255\n1 0 0 255\n0 1 0 255\n3 0 1 -2\n", "line 15: a face uses vertex -2"),
            ("0 0 0 255\n1 0 0 255\n0 1 0 255\n2 0 1\n", "line 15: expected a face"),
            ("0 0 0 255\n1 0 0 255\n0 1 0 255\n-3 0 1\n", "line 15: expected a number"),
            ("0 0 0 255\n1 0 0 255\n0 1 0 255\n3 0 1", "ends early: expected 1 rows of face"),
        ] {
            let error = text(rows).unwrap_err().to_string();
            assert!(error.contains(line), "wanted {line}, got {error}");
        }
    }

    #[test]
    fn lying_headers_allocate_nothing() {
        let bytes = samples::ply_binary(&samples::cube(), false);
        let start = bytes.windows(4).position(|w| w == b"end_").unwrap();
        let (head, body) = bytes.split_at(start);
        let head = String::from_utf8(head.to_vec()).unwrap();
        for (from, to) in [
            ("vertex 8", "vertex 4000000000"),
            ("face 12", "face 18446744073709551615"),
            ("uchar int", "uint int"),
        ] {
            let lie = [head.replace(from, to).as_bytes(), body].concat();
            let error = read(&lie).unwrap_err();
            assert!(matches!(error, MeshError::Truncated { .. }), "{to}: {error}");
        }
        let empty =
            [format!("{head}element ghost 18446744073709551615\n").as_bytes(), body].concat();
        assert_eq!(read(&empty), Ok(samples::cube()));
    }

    #[test]
    fn wrong_headers_are_named() {
        for (from, to, wanted) in [
            ("float z", "float w", "expected properties x, y and z"),
            ("vertex_indices", "texture", "expected a list property"),
            ("format ascii 1.0", "comment", "expected a \"format\" line"),
            ("property float x", "property complex x", "line 5: expected a property's type"),
            ("end_header", "comment", "line 12: expected a PLY header line"),
            ("element face", "element tristrips", "uses triangle strips"),
        ] {
            let rows = "0 0 0 255\n1 0 0 255\n0 1 0 255\n3 0 1 2\n";
            let error = read(format!("{HEAD}{rows}").replace(from, to).as_bytes()).unwrap_err();
            assert!(error.to_string().contains(wanted), "wanted {wanted}, got {error}");
        }
        assert!(matches!(read(&HEAD.as_bytes()[..150]), Err(MeshError::Truncated { .. })));
        let cloud = HEAD.replace("element face 1", "element face 0");
        let error =
            read(format!("{cloud}0 0 0 255\n1 0 0 255\n0 1 0 255\n").as_bytes()).unwrap_err();
        assert_eq!(error, MeshError::NoFaces { vertices: 3 });
    }
}
