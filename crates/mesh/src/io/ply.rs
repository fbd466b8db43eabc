//! PLY: a text header that declares elements with properties, then their rows as text or binary.
//!
//! Only `x`, `y`, `z` of `vertex` and the index lists of `face` and `tristrips` are used.

use super::MAX_VERTICES;
use super::builder::MeshBuilder;
use super::parse::{LineReader, excerpt, parse_number};
use super::ply_header::{Element, PlyEncoding, PlyType, PropertyRole, parse_header};
use crate::{Location, Mesh, MeshError};

pub(super) const FORMAT: &str = "PLY";

/// Whether the bytes start with the magic line of PLY.
pub(super) fn is_ply(bytes: &[u8]) -> bool {
    let line = bytes.split(|&b| b == b'\n' || b == b'\r').next().unwrap_or_default();
    line.trim_ascii_end().eq_ignore_ascii_case(b"ply")
}

/// Parses the faces, after a check of the header's counts against the file size.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let mut lines = LineReader::new(bytes);
    let (encoding, elements, line) = parse_header(&mut lines)?;
    let start = bytes.len() - lines.rest.len();
    let mut body = RowReader { bytes, offset: start, line, encoding };
    let mut builder = MeshBuilder::new(FORMAT, 0);
    let mut corners = Vec::new();
    if encoding != PlyEncoding::Text && elements.iter().any(Element::has_single_precision) {
        builder.set_single_precision();
    }
    for element in &elements {
        element.check(&body)?;
        // An element without properties has no bytes, regardless of the count in its header.
        let count = if element.properties.is_empty() { 0 } else { element.count };
        for row in 0..count {
            body.skip_space();
            let location = body.location();
            let (position, list) =
                body.row(element).map_err(|error| element.error(error, row, body.location()))?;
            if element.name == "vertex" {
                builder.add_vertex(position, location)?;
            } else if element.is_face() {
                corners.clear();
                for index in list {
                    // -1 ends a triangle strip.
                    if index == -1.0 && element.is_strip() {
                        builder.add_strip(&corners, location)?;
                        corners.clear();
                        continue;
                    }
                    let corner = index as u32;
                    if f64::from(corner) != index {
                        return Err(builder.bad_index(index as i64, location));
                    }
                    corners.push(corner);
                }
                if element.is_strip() {
                    builder.add_strip(&corners, location)?;
                } else {
                    builder.add_polygon(&corners, location)?;
                }
            }
        }
    }
    builder.finish()
}

/// Reason for an unreadable value: end of the file, or the invalid text found.
enum RowError {
    EndOfFile,
    NotANumber(String),
}

impl Element {
    /// Checks the declared properties and the count against the remaining bytes, before any row is parsed.
    fn check(&self, body: &RowReader<'_>) -> Result<(), MeshError> {
        let has = |role| self.properties.iter().any(|p| p.role == role);
        let expected = match &self.name[..] {
            "vertex" if !(0..3).all(|axis| has(PropertyRole::Coordinate(axis))) => {
                "properties x, y and z"
            }
            _ if self.is_face() && !has(PropertyRole::Corners) => "a list property vertex_indices",
            _ => {
                // A number in text takes a digit and a space; the last one needs no space.
                let sizes = self.properties.iter().map(|p| match body.encoding {
                    PlyEncoding::Text => 2,
                    _ => p.length.unwrap_or(p.value).size() as u64,
                });
                let row = sizes.sum::<u64>().max(1);
                let max_rows = ((body.bytes.len() - body.offset) as u64 + 1) / row;
                if self.count > max_rows && !self.properties.is_empty() {
                    return Err(self.truncated(format!("bytes for up to {max_rows}")));
                }
                return Ok(());
            }
        };
        let (location, found) =
            (Location::Line(self.line), format!("element {} without", self.name));
        Err(MeshError::Malformed { format: FORMAT, location, expected, found })
    }

    fn truncated(&self, found: String) -> MeshError {
        let expected = format!("{} rows of {} (declared in the header)", self.count, self.name);
        MeshError::Truncated { format: FORMAT, expected, found }
    }

    fn error(&self, error: RowError, row: u64, location: Location) -> MeshError {
        match error {
            RowError::EndOfFile => self.truncated(row.to_string()),
            RowError::NotANumber(found) => {
                MeshError::Malformed { format: FORMAT, location, expected: "a number", found }
            }
        }
    }
}

/// Reader of the rows after the header.
struct RowReader<'a> {
    bytes: &'a [u8],
    offset: usize,
    line: usize,
    encoding: PlyEncoding,
}

impl RowReader<'_> {
    fn location(&self) -> Location {
        match self.encoding {
            PlyEncoding::Text => Location::Line(self.line),
            _ => Location::Byte(self.offset),
        }
    }

    /// Reads the next row; returns its coordinates and index list (zero and empty if the element has none).
    fn row(&mut self, element: &Element) -> Result<([f64; 3], Vec<f64>), RowError> {
        let mut position = [0.0; 3];
        let mut corners = Vec::new();
        for property in &element.properties {
            let Some(length) = property.length else {
                let value = self.value(property.value)?;
                if let PropertyRole::Coordinate(axis) = property.role {
                    position[axis] = value;
                }
                continue;
            };
            let length = self.value(length)?;
            if !(0.0..=f64::from(u32::MAX)).contains(&length) {
                return Err(RowError::NotANumber(format!("a list of length {length}")));
            }
            for _ in 0..length as u32 {
                let value = self.value(property.value)?;
                // A longer face is rejected later; this bounds the memory.
                if property.role == PropertyRole::Corners && corners.len() < MAX_VERTICES {
                    corners.push(value);
                }
            }
        }
        Ok((position, corners))
    }

    fn value(&mut self, kind: PlyType) -> Result<f64, RowError> {
        let rest = match self.encoding {
            PlyEncoding::Text => {
                self.skip_space();
                &self.bytes[self.offset..]
            }
            _ => &self.bytes[self.offset..],
        };
        if self.encoding == PlyEncoding::Text {
            let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
            if end == 0 {
                return Err(RowError::EndOfFile);
            }
            self.offset += end;
            return parse_number(&rest[..end])
                .ok_or_else(|| RowError::NotANumber(excerpt(&rest[..end])));
        }
        let size = kind.size();
        let bytes = rest.get(..size).ok_or(RowError::EndOfFile)?;
        self.offset += size;
        let mut raw = [0; 8];
        raw[..size].copy_from_slice(bytes);
        if self.encoding == PlyEncoding::BigEndian {
            raw[..size].reverse();
        }
        Ok(kind.decode(raw))
    }

    /// In text, advances to the next token and counts lines.
    fn skip_space(&mut self) {
        while self.encoding == PlyEncoding::Text
            && let Some(byte) = self.bytes.get(self.offset).filter(|b| b.is_ascii_whitespace())
        {
            let is_end = *byte == b'\n'
                || (*byte == b'\r' && self.bytes.get(self.offset + 1) != Some(&b'\n'));
            self.line += usize::from(is_end);
            self.offset += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read;
    use crate::test_meshes;

    const HEAD: &str = "ply\nformat ascii 1.0\ncomment caf\u{e9}\nelement vertex 3\nproperty float x\n\
        property float y\nproperty float z\nproperty uchar red\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n";

    fn text(rows: &str) -> Result<Mesh, MeshError> {
        read(format!("{HEAD}{rows}").as_bytes())
    }

    #[test]
    fn both_byte_orders_give_the_same_mesh() {
        let cube = test_meshes::cube();
        for is_big in [false, true] {
            assert_eq!(read(&test_meshes::ply_binary(&cube, is_big)), Ok(cube.clone()));
        }
        assert_eq!(read(&test_meshes::ply_text(&cube)), Ok(cube));
    }

    #[test]
    fn text_error_names_its_line() {
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
    fn triangle_strips_are_read() {
        let rows = "0 0 0 255\n1 0 0 255\n0 1 0 255\n8 0 1 2 0 -1 2 1 0\n";
        let mesh = read(format!("{HEAD}{rows}").replace("face", "tristrips").as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 0], [2, 1, 0]]);
        let cut = rows.replace("8 0 1 2 0 -1 2 1 0", "2 0 1");
        let error = read(format!("{HEAD}{cut}").replace("face", "tristrips").as_bytes());
        assert_eq!(error, Err(MeshError::NoFaces { vertices: 3 }));
    }

    #[test]
    fn properties_are_found_in_any_order_and_case() {
        let head = "PLY \r\nformat ascii 1.0\r\nelement face 1\r\nproperty uchar flags\r\n\
            property list uchar float texcoord\r\nproperty list int short vertices\r\n\
            element vertex 3\r\nproperty double Z\r\nproperty uchar red\r\n\
            property list uchar int extra\r\nproperty double Y\r\nproperty double X\r\n\
            end_header\r\n";
        let rows = "7 2 0.5 0.5 3 0 1 2\r\n3 9 0 2 1\r\n3 9 1 7 2 1\r\n3 9 0 3 4\r\n";
        let mesh = read(format!("{head}{rows}").as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
        assert_eq!(mesh.vertices[2].to_array(), [4.0, 3.0, 3.0]);
    }

    #[test]
    fn excessive_header_counts_are_rejected_without_allocation() {
        let bytes = test_meshes::ply_binary(&test_meshes::cube(), false);
        let start = bytes.windows(4).position(|w| w == b"end_").unwrap();
        let (head, body) = bytes.split_at(start);
        let head = String::from_utf8(head.to_vec()).unwrap();
        for (from, to) in [
            ("vertex 8", "vertex 4000000000"),
            ("face 12", "face 18446744073709551615"),
            ("uchar int", "uint int"),
        ] {
            let invalid = [head.replace(from, to).as_bytes(), body].concat();
            let error = read(&invalid).unwrap_err();
            assert!(matches!(error, MeshError::Truncated { .. }), "{to}: {error}");
        }
        let empty =
            [format!("{head}element ghost 18446744073709551615\n").as_bytes(), body].concat();
        assert_eq!(read(&empty), Ok(test_meshes::cube()));
    }

    #[test]
    fn invalid_header_is_named_in_the_error() {
        for (from, to, wanted) in [
            ("float z", "float w", "expected properties x, y and z"),
            ("vertex_indices", "texture", "expected a list property"),
            ("format ascii 1.0", "comment", "expected a \"format\" line"),
            ("property float x", "property complex x", "line 5: expected a property's type"),
            ("end_header", "comment", "line 12: expected a PLY header line"),
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
