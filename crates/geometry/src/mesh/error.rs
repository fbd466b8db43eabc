//! What can be wrong with a mesh file: each message names the cause, what was found, and the cure.

use super::Unit;
use std::fmt;

/// Where in the file something stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line of text, counted from 1.
    Line(usize),
    /// A byte, counted from 0.
    Byte(usize),
    /// An entry of a list, counted from 0, such as accessor 3 of a glTF file.
    Entry(&'static str, usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::Entry(list, index) => write!(f, "{list} {index}"),
        }
    }
}

/// Why bytes did not become a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// There is nothing in the file.
    #[error(
        "the file is empty: expected a mesh as OBJ, STL, PLY, OFF, GLB or glTF. Export it again"
    )]
    Empty,
    /// More bytes than are read at all.
    #[error(
        "the file has {found} bytes: at most {limit} are read. Simplify the mesh, or drop its textures"
    )]
    TooLarge {
        /// Bytes in the file.
        found: usize,
        /// Bytes allowed.
        limit: usize,
    },
    /// More of something than is read at all.
    #[error(
        "the file has {found} {what} or more: at most {limit} are read. Simplify (decimate) the mesh"
    )]
    TooMany {
        /// What is counted.
        what: &'static str,
        /// How many were counted when reading stopped.
        found: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// The bytes are of some other kind.
    #[error(
        "this looks like {found}, not a mesh: expected OBJ, STL, PLY, OFF, GLB or glTF. Export it as one of these"
    )]
    NotAMesh {
        /// What the bytes look like.
        found: &'static str,
    },
    /// The file ends before its content does.
    #[error(
        "the {format} file ends early: expected {expected}, found {found}. Download or export it again"
    )]
    Truncated {
        /// Name of the file format.
        format: &'static str,
        /// What the file promises.
        expected: String,
        /// What it holds.
        found: String,
    },
    /// Something that the format does not allow.
    #[error("{format}, {place}: expected {expected}, found {found}. Export the mesh again")]
    Malformed {
        /// Name of the file format.
        format: &'static str,
        /// Where it stands.
        place: Place,
        /// What should stand there.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// A face names a vertex that does not exist.
    #[error("{place}: a face uses vertex {index}, but {limits}. Export the mesh again")]
    BadIndex {
        /// Where the face stands.
        place: Place,
        /// The index as the file has it.
        index: i64,
        /// Which indices would be right.
        limits: String,
    },
    /// A coordinate is not a number, or too large to compute with.
    #[error(
        "{place}: a coordinate is {found}: expected a number within +-{limit:e}. Repair the mesh in its editor"
    )]
    NotFinite {
        /// Where the vertex stands.
        place: Place,
        /// The coordinate.
        found: f64,
        /// Largest magnitude allowed, in units of the file.
        limit: f32,
    },
    /// Points only, or nothing at all.
    #[error(
        "the file has {vertices} vertices but no faces: expected a surface. Build one from the point cloud first"
    )]
    NoFaces {
        /// Vertices in the file.
        vertices: usize,
    },
    /// A glTF file that keeps its geometry elsewhere.
    #[error(
        "the glTF file keeps its geometry in another file ({uri}): expected it embedded. Export it as one GLB file"
    )]
    External {
        /// Where the geometry should be.
        uri: String,
    },
    /// A feature of the format that is not read.
    #[error("the {format} file uses {feature}, which is not supported. Export the mesh without it")]
    Unsupported {
        /// Name of the file format.
        format: &'static str,
        /// The feature.
        feature: String,
    },
    /// Triangles, but no surface.
    #[error(
        "all {triangles} triangles have zero area: expected a surface. Check the scale of the export"
    )]
    ZeroArea {
        /// Triangles in the file.
        triangles: usize,
    },
    /// A surface, but no solid: it lies in a plane.
    #[error("the mesh is flat: expected a solid with a volume. Give it thickness in its editor")]
    Flat,
    /// Nothing that one could put on a table.
    #[error(
        "the mesh is {longest} m long if its unit is the {unit}: expected 1 mm to 10 m. Choose another unit"
    )]
    Size {
        /// Longest side (m).
        longest: f32,
        /// The unit that was taken.
        unit: Unit,
    },
}
