//! Bytes to triangles: which format it is, the limits, and what all formats share.
//!
//! The format is told by content, never by name. The readers are our own, strict and small, except for the
//! JSON of glTF: of the libraries, mesh-loader expands every corner before anything can be counted, trusts a
//! binary STL's length over its header, and does not say at which line an index is wrong; ply-rs-bw loops as
//! often as the header claims for elements without properties, and refuses numbers such as `1.`.

use super::{Mesh, MeshError, Place, gltf, obj, off, ply, stl};
use crate::Vec3;

/// Largest file that is read (bytes).
pub const MAX_BYTES: usize = 250_000_000;
/// Most triangles that are read.
pub const MAX_TRIANGLES: usize = 5_000_000;
/// Most vertices that are read: what a soup of `MAX_TRIANGLES` needs.
pub(super) const MAX_VERTICES: usize = 3 * MAX_TRIANGLES;

/// Largest coordinate (units of the file); its cube still fits single precision.
const MAX_COORDINATE: f32 = 1e9;

/// Reads a mesh in the units of its file: OBJ, STL (text or binary), PLY (text or binary), OFF, GLB or glTF, z up.
pub fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    if bytes.len() > MAX_BYTES {
        return Err(MeshError::TooLarge { found: bytes.len(), limit: MAX_BYTES });
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if bytes.trim_ascii().is_empty() {
        return Err(MeshError::Empty);
    }
    if gltf::is_gltf(bytes) {
        gltf::read(bytes)
    } else if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
        ply::read(bytes)
    } else if off::is_off(bytes) {
        off::read(bytes)
    } else if let Some(found) = other_kind(bytes) {
        Err(MeshError::NotAMesh { found })
    } else if stl::is_binary(bytes) {
        stl::read_binary(bytes)
    } else if stl::is_text(bytes) {
        stl::read_text(bytes)
    } else if obj::is_obj(bytes) {
        obj::read(bytes)
    } else if is_text(bytes) {
        Err(MeshError::NotAMesh { found: "plain text" })
    } else {
        Err(MeshError::NotAMesh { found: "binary data of an unknown kind" })
    }
}

/// Whether a file of this kind says which way is up.
pub(super) fn says_up(bytes: &[u8]) -> bool {
    gltf::is_gltf(bytes)
}

/// What people drop by mistake, by its first bytes.
fn other_kind(bytes: &[u8]) -> Option<&'static str> {
    let kinds: [(&[u8], &str); 12] = [
        (b"\x89PNG", "a PNG picture"),
        (b"\xff\xd8\xff", "a JPEG picture"),
        (b"GIF8", "a GIF picture"),
        (b"RIFF", "a WebP picture or a sound"),
        (b"%PDF", "a PDF document"),
        (b"PK\x03\x04", "a ZIP archive or a 3MF file"),
        (b"\x1f\x8b", "a gzip archive"),
        (b"Kaydara FBX", "an FBX file"),
        (b"BLENDER", "a Blender file"),
        (b"ISO-10303-21", "a STEP file"),
        (b"{", "JSON"),
        (b"[", "JSON"),
    ];
    let start = bytes.trim_ascii_start();
    let known = kinds.iter().find(|(magic, _)| start.starts_with(magic)).map(|&(_, name)| name);
    known.or_else(|| {
        let head = start[..start.len().min(1000)].to_ascii_lowercase();
        let has = |word: &[u8]| head.windows(word.len()).any(|w| w == word);
        match start.first() {
            Some(b'<') if has(b"<collada") => Some("a COLLADA (.dae) file"),
            Some(b'<') if has(b"<html") || has(b"<!doctype html") => Some("a web page (HTML)"),
            Some(b'<') => Some("XML"),
            _ => None,
        }
    })
}

/// Whether the first bytes are text in ASCII, UTF-8 or Latin-1.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    bytes.iter().take(1000).all(|&b| b >= b' ' || b.is_ascii_whitespace())
}

/// Lines with their numbers, ended by any of \n, \r\n and \r.
pub(super) struct Lines<'a> {
    /// What follows the last line that was given out.
    pub(super) rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, number: 0 }
    }
}

impl<'a> Iterator for Lines<'a> {
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

/// The words of a line.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// A number written out, `nan` and `inf` included.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The three coordinates that `words` begins with; if one is missing, what stands in its place.
pub(super) fn coordinates<'a>(
    mut words: impl Iterator<Item = &'a [u8]>,
) -> Result<[f64; 3], String> {
    let mut next = || {
        let word = words.next().ok_or("the end of the line")?;
        number(word).ok_or_else(|| excerpt(word))
    };
    Ok([next()?, next()?, next()?])
}

/// The beginning of some bytes, fit for a message.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    let head = &bytes[..bytes.len().min(40)];
    let dots = if head.len() < bytes.len() { "..." } else { "" };
    format!("\"{}{dots}\"", String::from_utf8_lossy(head).escape_debug())
}

/// The mesh as far as it has been read; every format fills it through the same checks.
pub(super) struct Draft {
    format: &'static str,
    /// The index that the format gives to the first vertex.
    first_index: i64,
    mesh: Mesh,
    /// The largest vertex index used so far, and where: OBJ and PLY may name a vertex before they define it.
    highest: Option<(u32, Place)>,
}

impl Draft {
    pub(super) fn new(format: &'static str, first_index: i64) -> Self {
        Self { format, first_index, mesh: Mesh::default(), highest: None }
    }

    pub(super) fn num_vertices(&self) -> usize {
        self.mesh.vertices.len()
    }

    pub(super) fn num_triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    pub(super) fn vertex(&mut self, position: [f64; 3], place: Place) -> Result<(), MeshError> {
        check_count("vertices", self.num_vertices() as u64 + 1, MAX_VERTICES)?;
        let limit = MAX_COORDINATE;
        let is_usable = |x: &f64| x.is_finite() && x.abs() <= f64::from(limit);
        if let Some(&found) = position.iter().find(|x| !is_usable(x)) {
            return Err(MeshError::NotFinite { place, found, limit });
        }
        let [x, y, z] = position;
        self.mesh.vertices.push(Vec3::new(x as f32, y as f32, z as f32));
        Ok(())
    }

    /// Adds a face, cut into a fan of triangles; `corners` count from 0.
    pub(super) fn polygon(&mut self, corners: &[u32], place: Place) -> Result<(), MeshError> {
        let [first, rest @ ..] = corners else { return Err(self.too_few_corners(0, place)) };
        if rest.len() < 2 {
            return Err(self.too_few_corners(corners.len(), place));
        }
        let found = (self.num_triangles() + rest.len() - 1) as u64;
        check_count("triangles", found, MAX_TRIANGLES)?;
        let highest = corners.iter().fold(*first, |a, &b| a.max(b));
        if self.highest.is_none_or(|(index, _)| highest > index) {
            self.highest = Some((highest, place));
        }
        self.mesh.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        Ok(())
    }

    fn too_few_corners(&self, found: usize, place: Place) -> MeshError {
        let expected = "a face with at least 3 corners";
        MeshError::Malformed { format: self.format, place, expected, found: found.to_string() }
    }

    /// A face that uses `index`, as the file counts, which does not exist.
    pub(super) fn bad_index(&self, index: i64, place: Place) -> MeshError {
        let last = self.first_index + self.num_vertices() as i64 - 1;
        let limits = if self.num_vertices() == 0 {
            "there are no vertices".to_owned()
        } else {
            format!("there are vertices {} to {last}", self.first_index)
        };
        MeshError::BadIndex { place, index, limits }
    }

    pub(super) fn finish(self) -> Result<Mesh, MeshError> {
        match self.highest {
            None => Err(MeshError::NoFaces { vertices: self.num_vertices() }),
            Some((index, place)) if index as usize >= self.num_vertices() => {
                Err(self.bad_index(self.first_index + i64::from(index), place))
            }
            Some(_) => Ok(self.mesh),
        }
    }
}

/// Refuses more of `what` than are read.
pub(super) fn check_count(what: &'static str, found: u64, limit: usize) -> Result<(), MeshError> {
    let limit = limit as u64;
    if found > limit { Err(MeshError::TooMany { what, found, limit }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::samples;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn a_cube_has_the_same_volume_in_every_format() {
        for (name, bytes) in samples::all(&samples::cube()) {
            let mesh = read(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
            let volume = samples::volume(&mesh);
            assert!((volume - 1.0).abs() < 1e-6, "{name}: wanted 1, got {volume}");
            assert_eq!(mesh.triangles.len(), 12, "{name}");
        }
    }

    #[test]
    fn no_beginning_of_a_file_panics() {
        for (name, bytes) in samples::all(&samples::cube()) {
            for length in 0..bytes.len() {
                if let Ok(mesh) = read(&bytes[..length]) {
                    let indices = mesh.triangles.iter().flatten();
                    assert!(indices.max() < Some(&(mesh.vertices.len() as u32)), "{name}");
                }
            }
        }
    }

    #[test]
    fn no_mutation_of_a_file_panics() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for (name, bytes) in samples::all(&samples::cube()) {
            for _ in 0..2000 {
                let mut bytes = bytes.clone();
                for _ in 0..rng.random_range(1..6) {
                    let at = rng.random_range(0..bytes.len());
                    match rng.random_range(0..4) {
                        0 => bytes[at] = rng.random(),
                        1 => bytes[at] ^= 1 << rng.random_range(0..8),
                        2 => drop(bytes.remove(at)),
                        _ => bytes.insert(at, b"0123456789-./ \n\xff\0"[rng.random_range(0..17)]),
                    }
                }
                if let Ok(mesh) = read(&bytes) {
                    let healed = crate::mesh::heal(mesh);
                    assert!(
                        healed.is_err() || healed.is_ok_and(|(m, _)| !m.triangles.is_empty()),
                        "{name}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_not_a_mesh_is_named() {
        for (bytes, found) in [
            (&b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"[..], "a PNG picture"),
            (b"{\"object\": \"mug\"}", "JSON"),
            (b"<!DOCTYPE html><html><body>404</body></html>", "a web page (HTML)"),
            (b"<?xml version=\"1.0\"?><COLLADA/>", "a COLLADA (.dae) file"),
            (b"Dear reader,\nthis is a letter.\n", "plain text"),
            (b"\x00\x01\x02\x03 random", "binary data of an unknown kind"),
        ] {
            assert_eq!(read(bytes), Err(MeshError::NotAMesh { found }));
        }
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let noise: Vec<u8> = (0..3000).map(|_| rng.random()).collect();
        assert!(matches!(read(&noise), Err(MeshError::NotAMesh { .. })));
    }

    #[test]
    fn nothing_and_too_much_are_refused() {
        assert_eq!(read(b""), Err(MeshError::Empty));
        assert_eq!(read(b" \n\t"), Err(MeshError::Empty));
        let error = read(&vec![b' '; MAX_BYTES + 1]).unwrap_err();
        assert_eq!(error, MeshError::TooLarge { found: MAX_BYTES + 1, limit: MAX_BYTES });
        let fan = format!("v 0 0 0\nf{}\n", " 1".repeat(MAX_TRIANGLES + 3));
        let (found, limit) = (MAX_TRIANGLES as u64 + 1, MAX_TRIANGLES as u64);
        assert_eq!(
            read(fan.as_bytes()),
            Err(MeshError::TooMany { what: "triangles", found, limit })
        );
    }

    #[test]
    fn lines_end_in_any_of_the_three_ways() {
        let split: Vec<_> = Lines::new(b"a\r\nb\rc\n\nd").collect();
        assert_eq!(split, [(1, &b"a"[..]), (2, b"b"), (3, b"c"), (4, b""), (5, b"d")]);
    }
}
