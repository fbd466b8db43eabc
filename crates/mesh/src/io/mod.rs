//! Mesh parsing: format detection, limits, and the parts shared by all formats.
//!
//! The format is detected from the content, never from the file name. A file may be compressed by gzip. The parsers are strict and small; only
//! the JSON of glTF uses a library. mesh-loader expands every corner before a limit can apply, prefers the
//! length of a binary STL to its header, and does not report the line of an invalid index. ply-rs-bw loops
//! over the header's count for elements without properties, and rejects numbers such as `1.`.

mod accessor;
mod builder;
mod container;
mod data_uri;
mod glb;
mod gltf;
mod gltf_extensions;
mod gltf_skin;
mod obj;
mod off;
mod parse;
mod ply;
mod ply_header;
mod polygon;
mod stl;
mod stl_binary;
mod stl_text;

use crate::unit::FormatUnit;
use crate::{Mesh, MeshError, Unit, UpAxis};
use container::{gunzip, is_gzip, utf16_to_utf8};
use parse::is_text;
pub(crate) use polygon::triangulate;
use std::borrow::Cow;

/// Max file size (bytes).
pub const MAX_BYTES: usize = 250_000_000;
/// Max number of triangles.
pub const MAX_TRIANGLES: usize = 5_000_000;
/// Max number of vertices: enough for a triangle soup of `MAX_TRIANGLES`.
const MAX_VERTICES: usize = 3 * MAX_TRIANGLES;

/// Parses a mesh in one of the [`FORMATS`], text or binary.
///
/// Out: coordinates in the units of the file; glTF is converted to z up.
///
/// ```rust
/// // A tetrahedron as OBJ. The coordinates keep the units of the file.
/// let obj = b"v 0 0 0\nv 60 0 0\nv 0 40 0\nv 0 0 120\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
/// let tetrahedron = mesh::read(obj)?;
/// assert_eq!(tetrahedron.triangles.len(), 4);
/// assert_eq!(tetrahedron.extent().to_array(), [60.0, 40.0, 120.0]);
/// # Ok::<(), mesh::MeshError>(())
/// ```
pub fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    read_with_files(bytes, NO_EXTERNAL_FILES)
}

/// Content of a file to which the mesh refers, by its path relative to the mesh; `None` if it is missing.
///
/// The path comes from the mesh file: an implementation must not leave the folder of the mesh.
pub type ExternalFiles<'a> = dyn Fn(&str) -> Option<Vec<u8>> + 'a;

/// No file other than the mesh is available.
pub const NO_EXTERNAL_FILES: &ExternalFiles<'static> = &|_| None;

/// [`read`] for a glTF file with its buffers in other files.
pub fn read_with_files(bytes: &[u8], files: &ExternalFiles) -> Result<Mesh, MeshError> {
    read_format(bytes, files).map(|(mesh, _)| mesh)
}

/// Parses a mesh and returns its format.
pub(crate) fn read_format(
    bytes: &[u8],
    files: &ExternalFiles,
) -> Result<(Mesh, &'static MeshFormat), MeshError> {
    let bytes = &unpacked(bytes)?;
    if bytes.trim_ascii().is_empty() {
        return Err(MeshError::Empty);
    }
    let detect = |has_magic: bool| {
        let parsers = FORMATS.iter().zip(&PARSERS);
        let mut parsers = parsers.filter(|(_, parser)| parser.has_magic == has_magic);
        parsers.find_map(|(format, parser)| Some(((parser.detect)(bytes)?, format)))
    };
    // The text before a binary STL may begin like another format.
    let exact = stl::detect_exact(bytes).map(|read| (read, &FORMATS[STL]));
    let found = exact.or_else(|| detect(true));
    if let (None, Some(found)) = (&found, sniff_foreign_format(bytes)) {
        return Err(MeshError::UnknownFormat { found });
    }
    match found.or_else(|| detect(false)) {
        Some((read, format)) => Ok((read(bytes, files)?, format)),
        None if is_text(bytes) => Err(MeshError::UnknownFormat { found: "plain text" }),
        None => Err(MeshError::UnknownFormat { found: "binary data of an unknown type" }),
    }
}

/// The bytes of the mesh without compression by gzip and without a byte order mark, in UTF-8.
fn unpacked(bytes: &[u8]) -> Result<Cow<'_, [u8]>, MeshError> {
    let check = |length: usize| match length > MAX_BYTES {
        true => Err(MeshError::TooLarge { found: length, limit: MAX_BYTES }),
        false => Ok(()),
    };
    check(bytes.len())?;
    let bytes = if is_gzip(bytes) { Cow::Owned(gunzip(bytes)?) } else { Cow::Borrowed(bytes) };
    check(bytes.len())?;
    let bytes = utf16_to_utf8(&bytes).map_or(bytes, Cow::Owned);
    Ok(match bytes {
        Cow::Borrowed(bytes) => Cow::Borrowed(bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes)),
        Cow::Owned(mut bytes) => {
            if bytes.starts_with(BYTE_ORDER_MARK) {
                bytes.drain(..BYTE_ORDER_MARK.len());
            }
            Cow::Owned(bytes)
        }
    })
}

/// Byte order mark in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Parser of one format.
type Reader = fn(&[u8], &ExternalFiles) -> Result<Mesh, MeshError>;

/// A mesh format. A new format is a module of this folder, and a row of [`FORMATS`] and of `PARSERS`.
pub struct MeshFormat {
    /// Names in messages and help texts.
    pub names: &'static [&'static str],
    /// File extensions without a dot, lower case. They are hints for users; detection reads the content.
    pub extensions: &'static [&'static str],
    /// Unit of the coordinates, if the format defines it or its files agree on it.
    pub(crate) unit: Option<FormatUnit>,
    /// Axis of the file that points up, if the format defines it or its files agree on it.
    pub(crate) up: Option<UpAxis>,
}

/// Parser of a mesh format. Apart from [`MeshFormat`], so that messages about formats do not link the parsers.
struct Parser {
    /// Whether the first bytes identify the format. Formats without magic bytes are tried last, after other
    /// known file types are excluded.
    has_magic: bool,
    /// Returns the parser if the bytes are of this format.
    detect: fn(&[u8]) -> Option<Reader>,
}

/// All formats, in the order of detection.
pub const FORMATS: [MeshFormat; 5] = [
    MeshFormat {
        names: &["glTF", "GLB"],
        extensions: &["glb", "gltf"],
        unit: Some(FormatUnit { unit: Unit::Metre, reason: "as glTF defines" }),
        up: Some(UpAxis::Y),
    },
    MeshFormat { names: &["OFF"], extensions: &["off"], unit: None, up: None },
    MeshFormat { names: &["PLY"], extensions: &["ply"], unit: None, up: None },
    MeshFormat {
        names: &["STL"],
        extensions: &["stl"],
        unit: Some(FormatUnit { unit: Unit::Millimetre, reason: "as usual in STL" }),
        up: Some(UpAxis::Z),
    },
    MeshFormat { names: &["OBJ"], extensions: &["obj"], unit: None, up: None },
];

/// Parsers of [`FORMATS`], in the same order.
const PARSERS: [Parser; 5] = [
    Parser {
        has_magic: true,
        detect: |bytes| gltf::is_gltf(bytes).then_some(gltf::read as Reader),
    },
    Parser {
        has_magic: true,
        detect: |bytes| off::is_off(bytes).then_some((|b, _| off::read(b)) as Reader),
    },
    Parser {
        has_magic: true,
        detect: |bytes| ply::is_ply(bytes).then_some((|b, _| ply::read(b)) as Reader),
    },
    Parser { has_magic: false, detect: stl::detect },
    Parser {
        has_magic: false,
        detect: |bytes| obj::is_obj(bytes).then_some((|b, _| obj::read(b)) as Reader),
    },
];

/// Index of STL in [`FORMATS`].
const STL: usize = 3;

/// Names of all formats, for messages: the names of [`FORMATS`] in reverse order, the last after "or".
pub fn format_list() -> String {
    let mut names: Vec<&str> = FORMATS.iter().flat_map(|format| format.names).copied().collect();
    names.reverse();
    match names.split_last() {
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
        None => String::new(),
    }
}

/// Type of a common non-mesh file, from its first bytes; `None` if unknown.
fn sniff_foreign_format(bytes: &[u8]) -> Option<&'static str> {
    let types: [(&[u8], &str); 17] = [
        (b"\x89PNG", "a PNG image"),
        (b"\xff\xd8\xff", "a JPEG image"),
        (b"GIF8", "a GIF image"),
        (b"RIFF", "a WebP image or an audio file"),
        (b"%PDF", "a PDF document"),
        (b"PK\x03\x04", "a ZIP archive or a 3MF file"),
        (b"Kaydara FBX", "an FBX file"),
        (b"BLENDER", "a Blender file"),
        (b"ISO-10303-21", "a STEP file"),
        (b"; FBX", "an FBX file"),
        (b"PXR-USDC", "a USD file"),
        (b"#usda", "a USD file"),
        (b"#VRML", "a VRML file"),
        (b"Rar!", "a RAR archive"),
        (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
        (b"\x28\xb5\x2f\xfd", "a file compressed by zstd, such as a Blender file"),
        (b"version https://git-lfs", "a pointer of Git LFS, which stands for the real file"),
    ];
    let start = bytes.trim_ascii_start();
    let known = types.iter().find(|(magic, _)| start.starts_with(magic)).map(|&(_, name)| name);
    known.or_else(|| {
        let head = start[..start.len().min(1000)].to_ascii_lowercase();
        let has = |tag: &[u8]| head.windows(tag.len()).any(|window| window == tag);
        // The free text of a binary STL may begin with these characters.
        match start.first().filter(|_| is_text(bytes)) {
            Some(b'{' | b'[') => Some("JSON"),
            Some(b'<') if has(b"<collada") => Some("a COLLADA (.dae) file"),
            Some(b'<') if has(b"<html") || has(b"<!doctype html") => Some("a web page (HTML)"),
            Some(b'<') => Some("XML"),
            Some(b'0') if has(b"section") => Some("a DXF file"),
            _ => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::parse::LineReader;
    use super::*;
    use crate::test_meshes;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn cube_has_the_same_volume_in_every_format() {
        for (name, bytes) in test_meshes::all(&test_meshes::cube()) {
            let mesh = read(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
            let volume = test_meshes::volume(&mesh);
            assert!((volume - 1.0).abs() < 1e-6, "{name}: wanted 1, got {volume}");
            assert_eq!(mesh.triangles.len(), 12, "{name}");
        }
    }

    #[test]
    fn truncated_files_do_not_panic() {
        for (name, bytes) in test_meshes::all(&test_meshes::cube()) {
            for length in 0..bytes.len() {
                if let Ok(mesh) = read(&bytes[..length]) {
                    let indices = mesh.triangles.iter().flatten();
                    assert!(indices.max() < Some(&(mesh.vertices.len() as u32)), "{name}");
                }
            }
        }
    }

    #[test]
    fn mutated_files_do_not_panic() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for (name, bytes) in test_meshes::all(&test_meshes::cube()) {
            for _ in 0..2000 {
                let mut bytes = bytes.clone();
                for _ in 0..rng.random_range(1..6) {
                    let offset = rng.random_range(0..bytes.len());
                    match rng.random_range(0..4) {
                        0 => bytes[offset] = rng.random(),
                        1 => bytes[offset] ^= 1 << rng.random_range(0..8),
                        2 => drop(bytes.remove(offset)),
                        _ => {
                            bytes.insert(offset, b"0123456789-./ \n\xff\0"[rng.random_range(0..17)])
                        }
                    }
                }
                if let Ok(mesh) = read(&bytes) {
                    let repaired = crate::repair(mesh);
                    assert!(
                        repaired.is_err() || repaired.is_ok_and(|(m, _)| !m.triangles.is_empty()),
                        "{name}"
                    );
                }
            }
        }
    }

    #[test]
    fn foreign_format_is_named_in_the_error() {
        for (bytes, found) in [
            (&b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"[..], "a PNG image"),
            (b"{\"object\": \"mug\"}", "JSON"),
            (b"<!DOCTYPE html><html><body>404</body></html>", "a web page (HTML)"),
            (b"<?xml version=\"1.0\"?><COLLADA/>", "a COLLADA (.dae) file"),
            (b"; FBX 7.4.0 project file\nFBXHeaderExtension: {\n}\n", "an FBX file"),
            (b"#usda 1.0\ndef Mesh \"cup\" {}\n", "a USD file"),
            (b"#VRML V2.0 utf8\nShape {}\n", "a VRML file"),
            (b"Rar!\x1a\x07\x01\0 data", "a RAR archive"),
            (b"  0\r\nSECTION\r\n  2\r\nHEADER\r\n", "a DXF file"),
            (
                b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n",
                "a pointer of Git LFS, which stands for the real file",
            ),
            (b"Dear reader,\nthis is a letter.\n", "plain text"),
            (b"\x00\x01\x02\x03 random", "binary data of an unknown type"),
        ] {
            assert_eq!(read(bytes), Err(MeshError::UnknownFormat { found }));
        }
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let noise: Vec<u8> = (0..3000).map(|_| rng.random()).collect();
        assert!(matches!(read(&noise), Err(MeshError::UnknownFormat { .. })));
    }

    #[test]
    fn empty_and_oversized_files_are_rejected() {
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
    fn all_three_line_endings_are_accepted() {
        let split: Vec<_> = LineReader::new(b"a\r\nb\rc\n\nd").collect();
        assert_eq!(split, [(1, &b"a"[..]), (2, b"b"), (3, b"c"), (4, b""), (5, b"d")]);
    }
}
