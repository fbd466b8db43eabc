//! The header of a PLY file: which elements it has, and of what types.

use super::ply::FORMAT;
use super::read::{Lines, check_count, excerpt, words};
use super::{MeshError, Place};

/// Most elements and properties in a header; scanners write fewer than 20.
const MAX_ENTRIES: usize = 1000;

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy)]
pub(super) enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

/// What a property is to us.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Role {
    Coordinate(usize),
    Corners,
    Skipped,
}

pub(super) struct Property {
    pub(super) role: Role,
    /// The type of the length in front of a list.
    pub(super) length: Option<Type>,
    pub(super) value: Type,
}

pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// Where it is declared.
    pub(super) line: usize,
}

/// Reads up to `end_header`: the encoding, the elements in file order, and the number of the header's last line.
pub(super) fn header(lines: &mut Lines<'_>) -> Result<(Encoding, Vec<Element>, usize), MeshError> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut entries = 0;
    while let Some((line, text)) = lines.next() {
        let malformed = |expected| {
            let (place, found) = (Place::Line(line), excerpt(text));
            MeshError::Malformed { format: FORMAT, place, expected, found }
        };
        let words: Vec<&[u8]> = words(text).take(6).collect();
        if lines.rest.is_empty() && words != [b"end_header"] {
            break;
        }
        match words[..] {
            [] | [b"ply" | b"comment" | b"obj_info", ..] => continue,
            [b"format", word, _] => {
                encoding = Some(match word {
                    b"ascii" => Encoding::Text,
                    b"binary_little_endian" => Encoding::LittleEndian,
                    b"binary_big_endian" => Encoding::BigEndian,
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
                let element = elements.last_mut().ok_or_else(|| malformed("an element first"))?;
                let property = Property::parse(&words[1..]);
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
        check_count("header entries", entries, MAX_ENTRIES)?;
    }
    let (expected, found) = ("\"end_header\"".to_owned(), "the end of the file".to_owned());
    Err(MeshError::Truncated { format: FORMAT, expected, found })
}

impl Property {
    fn parse(words: &[&[u8]]) -> Option<Self> {
        let (length, value, name) = match *words {
            [value, name] => (None, Type::parse(value)?, name),
            [b"list", length, value, name] => {
                (Some(Type::parse(length)?), Type::parse(value)?, name)
            }
            _ => return None,
        };
        let role = match (name, length) {
            (b"x", None) => Role::Coordinate(0),
            (b"y", None) => Role::Coordinate(1),
            (b"z", None) => Role::Coordinate(2),
            (b"vertex_indices" | b"vertex_index", Some(_)) => Role::Corners,
            _ => Role::Skipped,
        };
        Some(Self { role, length, value })
    }
}

impl Type {
    fn parse(word: &[u8]) -> Option<Self> {
        Some(match word {
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

    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The value of `size()` bytes, the most significant byte last.
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
