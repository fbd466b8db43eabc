//! Header of a PLY file: encoding, elements and property types.

use super::parse::{LineReader, check_limit, excerpt, tokens};
use super::ply::FORMAT;
use crate::{Location, MeshError};

/// Max number of elements and properties in a header; scanners write fewer than 20.
const MAX_ENTRIES: usize = 1000;

/// Encoding of the rows after the header.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum PlyEncoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// Scalar type of a property.
#[derive(Clone, Copy)]
pub(super) enum PlyType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// Use of a property by the parser.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum PropertyRole {
    /// Coordinate x, y or z (0 to 2) of a vertex.
    Coordinate(usize),
    /// List of the vertex indices of a face.
    Corners,
    Skipped,
}

pub(super) struct Property {
    pub(super) role: PropertyRole,
    /// Type of the length before a list; `None` for a scalar property.
    pub(super) length: Option<PlyType>,
    pub(super) value: PlyType,
}

pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// Line of the declaration, counted from 1.
    pub(super) line: usize,
}

/// Parses the header up to `end_header`.
///
/// Returns the encoding, the elements in file order, and the number of the first line after the header.
pub(super) fn parse_header(
    lines: &mut LineReader<'_>,
) -> Result<(PlyEncoding, Vec<Element>, usize), MeshError> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut entries = 0;
    while let Some((line, text)) = lines.next() {
        let malformed = |expected| {
            let (location, found) = (Location::Line(line), excerpt(text));
            MeshError::Malformed { format: FORMAT, location, expected, found }
        };
        let tokens: Vec<&[u8]> = tokens(text).take(6).collect();
        if lines.rest.is_empty() && tokens != [b"end_header"] {
            break;
        }
        match tokens[..] {
            [] | [b"comment" | b"obj_info", ..] => continue,
            // The magic line, in any case.
            _ if line == 1 => continue,
            [b"format", name, _] => {
                encoding = Some(match name {
                    b"ascii" => PlyEncoding::Text,
                    b"binary_little_endian" => PlyEncoding::LittleEndian,
                    b"binary_big_endian" => PlyEncoding::BigEndian,
                    _ => {
                        return Err(malformed(
                            "ascii or binary_little_endian or binary_big_endian",
                        ));
                    }
                });
            }
            [b"element", name, count] => {
                let count = std::str::from_utf8(count).ok().and_then(|text| text.parse().ok());
                let count = count.ok_or_else(|| malformed("a count after the element's name"))?;
                let name = String::from_utf8_lossy(&name[..name.len().min(40)]).into_owned();
                elements.push(Element { name, count, properties: Vec::new(), line });
            }
            [b"property", ..] => {
                let element = elements
                    .last_mut()
                    .ok_or_else(|| malformed("an element before its properties"))?;
                let property = Property::parse(&tokens[1..]);
                element
                    .properties
                    .push(property.ok_or_else(|| malformed("a property's type and name"))?);
            }
            [b"end_header"] => {
                let encoding =
                    encoding.ok_or_else(|| malformed("a \"format\" line before this"))?;
                return Ok((encoding, elements, line + 1));
            }
            _ => return Err(malformed("a PLY header line")),
        }
        entries += 1;
        check_limit("header entries", entries, MAX_ENTRIES)?;
    }
    let (expected, found) = ("\"end_header\"".to_owned(), "the end of the file".to_owned());
    Err(MeshError::Truncated { format: FORMAT, expected, found })
}

impl Element {
    /// Whether the rows are faces or triangle strips.
    pub(super) fn is_face(&self) -> bool {
        self.name == "face" || self.is_strip()
    }

    pub(super) fn is_strip(&self) -> bool {
        self.name == "tristrips"
    }

    /// Whether the coordinates are in single precision.
    pub(super) fn has_single_precision(&self) -> bool {
        let is_coordinate = |p: &&Property| matches!(p.role, PropertyRole::Coordinate(_));
        self.properties.iter().filter(is_coordinate).any(|p| matches!(p.value, PlyType::F32))
    }
}

impl Property {
    fn parse(tokens: &[&[u8]]) -> Option<Self> {
        let (length, value, name) = match *tokens {
            [value, name] => (None, PlyType::parse(value)?, name),
            [b"list", length, value, name] => {
                (Some(PlyType::parse(length)?), PlyType::parse(value)?, name)
            }
            _ => return None,
        };
        let role = match (&name.to_ascii_lowercase()[..], length) {
            (b"x", None) => PropertyRole::Coordinate(0),
            (b"y", None) => PropertyRole::Coordinate(1),
            (b"z", None) => PropertyRole::Coordinate(2),
            (b"vertex_indices" | b"vertex_index" | b"vertices", Some(_)) => PropertyRole::Corners,
            _ => PropertyRole::Skipped,
        };
        Some(Self { role, length, value })
    }
}

impl PlyType {
    fn parse(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Size of a binary value (bytes).
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Decodes the first `size()` bytes, little-endian.
    pub(super) fn decode(self, mut raw: [u8; 8]) -> f64 {
        raw[self.size()..].fill(0);
        let bits = u64::from_le_bytes(raw);
        match self {
            Self::I8 => f64::from(bits as i8),
            Self::U8 => f64::from(bits as u8),
            Self::I16 => f64::from(bits as i16),
            Self::U16 => f64::from(bits as u16),
            Self::I32 => f64::from(bits as i32),
            Self::U32 => f64::from(bits as u32),
            Self::F32 => f64::from(f32::from_bits(bits as u32)),
            Self::F64 => f64::from_bits(bits),
        }
    }
}
