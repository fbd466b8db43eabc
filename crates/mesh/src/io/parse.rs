//! Parts shared by the parsers: lines, tokens, numbers, and the mesh under construction with its limits.

use super::{MAX_TRIANGLES, MAX_VERTICES};
use crate::{Location, Mesh, MeshError};
use glamx::Vec3;

/// Max magnitude of a coordinate (units of the file); its cube fits single precision.
const MAX_COORDINATE: f32 = 1e9;

/// Whether the first 1000 bytes are text in ASCII, UTF-8 or Latin-1.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    bytes.iter().take(1000).all(|&b| b >= b' ' || b.is_ascii_whitespace())
}

/// Iterator over lines and their numbers (from 1); a line ends with \n, \r\n or \r.
pub(super) struct LineReader<'a> {
    /// Bytes after the last returned line.
    pub(super) rest: &'a [u8],
    number: usize,
}

impl<'a> LineReader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, number: 0 }
    }
}

impl<'a> Iterator for LineReader<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let is_end = |&b: &u8| b == b'\n' || b == b'\r';
        let end = self.rest.iter().position(is_end).unwrap_or(self.rest.len());
        let (line, tail) = self.rest.split_at(end);
        if line.is_empty() && tail.is_empty() {
            return None;
        }
        self.rest = tail.strip_prefix(b"\r\n").unwrap_or(tail.get(1..).unwrap_or(&[]));
        self.number += 1;
        Some((self.number, line))
    }
}

/// Tokens of a line, separated by ASCII white space.
pub(super) fn tokens(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|token| !token.is_empty())
}

/// Parses a decimal number, `nan` or `inf`.
pub(super) fn parse_number(token: &[u8]) -> Option<f64> {
    std::str::from_utf8(token).ok()?.parse().ok()
}

/// Parses the first three tokens as coordinates.
///
/// The error is the invalid token, quoted, or "the end of the line".
pub(super) fn parse_coordinates<'a>(
    mut tokens: impl Iterator<Item = &'a [u8]>,
) -> Result<[f64; 3], String> {
    let mut next = || {
        let token = tokens.next().ok_or("the end of the line")?;
        parse_number(token).ok_or_else(|| excerpt(token))
    };
    Ok([next()?, next()?, next()?])
}

/// First 40 bytes, quoted and escaped for an error message.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    let head = &bytes[..bytes.len().min(40)];
    let ellipsis = if head.len() < bytes.len() { "..." } else { "" };
    format!("\"{}{ellipsis}\"", String::from_utf8_lossy(head).escape_debug())
}

/// Mesh under construction; applies the same checks to every format.
pub(super) struct MeshBuilder {
    format: &'static str,
    /// Index of the first vertex in the format: 0, or 1 for OBJ.
    first_index: i64,
    mesh: Mesh,
    /// Max vertex index used so far, with its location: OBJ and PLY may use a vertex before its definition.
    max_index: Option<(u32, Location)>,
}

impl MeshBuilder {
    pub(super) fn new(format: &'static str, first_index: i64) -> Self {
        Self { format, first_index, mesh: Mesh::default(), max_index: None }
    }

    pub(super) fn num_vertices(&self) -> usize {
        self.mesh.vertices.len()
    }

    pub(super) fn num_triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Adds a vertex, after checks of count and coordinates.
    pub(super) fn add_vertex(
        &mut self,
        position: [f64; 3],
        location: Location,
    ) -> Result<(), MeshError> {
        check_limit("vertices", self.num_vertices() as u64 + 1, MAX_VERTICES)?;
        let limit = MAX_COORDINATE;
        let is_valid = |x: &f64| x.is_finite() && x.abs() <= f64::from(limit);
        if let Some(&found) = position.iter().find(|x| !is_valid(x)) {
            return Err(MeshError::NotFinite { location, found, limit });
        }
        let [x, y, z] = position;
        self.mesh.vertices.push(Vec3::new(x as f32, y as f32, z as f32));
        Ok(())
    }

    /// Adds a face as a triangle fan; `corners` are vertex indices from 0.
    pub(super) fn add_polygon(
        &mut self,
        corners: &[u32],
        location: Location,
    ) -> Result<(), MeshError> {
        let [first, rest @ ..] = corners else { return Err(self.too_few_corners(0, location)) };
        if rest.len() < 2 {
            return Err(self.too_few_corners(corners.len(), location));
        }
        let found = (self.num_triangles() + rest.len() - 1) as u64;
        check_limit("triangles", found, MAX_TRIANGLES)?;
        let max_index = corners.iter().fold(*first, |a, &b| a.max(b));
        if self.max_index.is_none_or(|(index, _)| max_index > index) {
            self.max_index = Some((max_index, location));
        }
        self.mesh.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        Ok(())
    }

    fn too_few_corners(&self, found: usize, location: Location) -> MeshError {
        let expected = "a face with at least 3 corners";
        MeshError::Malformed { format: self.format, location, expected, found: found.to_string() }
    }

    /// Error for a face with the undefined vertex `index`, counted as in the file.
    pub(super) fn bad_index(&self, index: i64, location: Location) -> MeshError {
        let last = self.first_index + self.num_vertices() as i64 - 1;
        let limits = if self.num_vertices() == 0 {
            "there are no vertices".to_owned()
        } else {
            format!("there are vertices {} to {last}", self.first_index)
        };
        MeshError::BadIndex { location, index, limits }
    }

    /// Returns the mesh, after a check of the vertex indices.
    pub(super) fn finish(self) -> Result<Mesh, MeshError> {
        match self.max_index {
            None => Err(MeshError::NoFaces { vertices: self.num_vertices() }),
            Some((index, location)) if index as usize >= self.num_vertices() => {
                Err(self.bad_index(self.first_index + i64::from(index), location))
            }
            Some(_) => Ok(self.mesh),
        }
    }
}

/// Fails if `found` items (`what`, plural) exceed `limit`.
pub(super) fn check_limit(what: &'static str, found: u64, limit: usize) -> Result<(), MeshError> {
    let limit = limit as u64;
    if found > limit { Err(MeshError::TooMany { what, found, limit }) } else { Ok(()) }
}
