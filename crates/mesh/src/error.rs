//! Errors of mesh files: each message names the cause, the expected and found values, and the cure.

use crate::Unit;
use crate::io::format_list;
use std::fmt;

/// Location in a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Location {
    /// Line of a text file, counted from 1.
    Line(usize),
    /// Byte offset, counted from 0.
    Byte(usize),
    /// Entry of a list, counted from 0, such as accessor 3 of a glTF file.
    Entry(&'static str, usize),
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::Entry(list, index) => write!(f, "{list} {index}"),
        }
    }
}

/// Error of mesh parsing, repair or import; Display gives "cause. cure" without a final full stop.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The file is empty or contains only white space.
    #[error("the file is empty: expected a mesh as {}. Export it again", format_list())]
    Empty,
    /// The file is larger than [`MAX_BYTES`](crate::MAX_BYTES).
    #[error(
        "the file has {found} bytes; the limit is {limit}. Simplify the mesh, or remove its textures"
    )]
    TooLarge {
        /// Size of the file (bytes).
        found: usize,
        /// Max size (bytes).
        limit: usize,
    },
    /// A count exceeds its limit.
    #[error("the file has {found} or more {what}; the limit is {limit}. {}", cure_of_excess(what))]
    TooMany {
        /// Counted items, plural.
        what: &'static str,
        /// Count at which parsing stopped.
        found: u64,
        /// Max count.
        limit: u64,
    },
    /// The file is not in a supported mesh format.
    #[error(
        "this looks like {found}, not a mesh: expected {}. Export it as one of these",
        format_list()
    )]
    UnknownFormat {
        /// Detected file type, with article.
        found: &'static str,
    },
    /// The file ends before its content is complete.
    #[error(
        "the {format} file ends early: expected {expected}, found {found}. Download or export it again"
    )]
    Truncated {
        /// Name of the file format.
        format: &'static str,
        /// Content announced by the header or required by the format.
        expected: String,
        /// Content found.
        found: String,
    },
    /// The content violates the format.
    #[error("{format}, {location}: expected {expected}, found {found}. Export the mesh again")]
    Malformed {
        /// Name of the file format.
        format: &'static str,
        /// Location of the invalid content.
        location: Location,
        /// Content required by the format.
        expected: &'static str,
        /// Content found.
        found: String,
    },
    /// A face uses an undefined vertex.
    #[error("{location}: a face uses vertex {index}, but {limits}. Export the mesh again")]
    BadIndex {
        /// Location of the face.
        location: Location,
        /// Vertex index as in the file.
        index: i64,
        /// Range of valid indices, as text.
        limits: String,
    },
    /// A coordinate is not finite, or too large for single precision.
    #[error(
        "{location}: a coordinate is {found}: expected a number within +-{limit:e}. Repair the mesh in a mesh editor"
    )]
    NotFinite {
        /// Location of the vertex.
        location: Location,
        /// Invalid coordinate (units of the file).
        found: f64,
        /// Max magnitude (units of the file).
        limit: f64,
    },
    /// The file stores distant coordinates in single precision.
    #[error(
        "the mesh is {distance} units from the origin, where the single precision of the file has steps of {step} units: expected steps below a thousandth of its size. Move the mesh to the origin and export it again"
    )]
    Imprecise {
        /// Distance of the centre from the origin along an axis (units of the file).
        distance: f64,
        /// Spacing of single-precision numbers there (units of the file).
        step: f64,
    },
    /// The file has no faces: a point cloud, or no geometry.
    #[error(
        "the file has {vertices} vertices but no faces: expected a surface. Reconstruct one from the point cloud first"
    )]
    NoFaces {
        /// Number of vertices in the file.
        vertices: usize,
    },
    /// A glTF file with geometry in an external buffer.
    #[error(
        "the geometry of the glTF file is in another file, {uri}, which is missing. Add that file, in the same folder or archive, or export the mesh as one GLB file"
    )]
    ExternalBuffer {
        /// URI of the buffer, quoted.
        uri: String,
    },
    /// The file uses an unsupported feature of its format.
    #[error("the {format} file uses {feature}, which is not supported. Export the mesh without it")]
    Unsupported {
        /// Name of the file format.
        format: &'static str,
        /// Name of the unsupported feature.
        feature: String,
    },
    /// All triangles have zero area.
    #[error(
        "all {triangles} triangles have zero area: expected a surface. Check the scale of the export"
    )]
    ZeroArea {
        /// Number of triangles in the file.
        triangles: usize,
    },
    /// The surface is planar and encloses no volume.
    #[error("the mesh is flat: expected a solid with a volume. Add thickness in a mesh editor")]
    Flat,
    /// The options do not tell how large the mesh is, and neither does the file.
    #[error(
        "the mesh is {length}: expected an object of 5 mm to 50 cm. Give its size, unit or scale"
    )]
    SizeRequired {
        /// Longest side of the bounding box, with the unit of the format.
        length: String,
    },
    /// An option of the import is invalid.
    #[error("the option {option} of the mesh is invalid: expected {expected}. Correct the option")]
    InvalidOption {
        /// Name of the option.
        option: &'static str,
        /// Valid values.
        expected: &'static str,
    },
    /// The size is implausible for an object: outside 1 mm to 10 m.
    #[error(
        "the mesh is {longest} m long if the unit is the {unit}: expected 1 mm to 10 m. Choose another unit or size"
    )]
    SizeOutOfRange {
        /// Longest side of the bounding box (m).
        longest: f32,
        /// Guessed or given unit.
        unit: Unit,
    },
}

/// Cure for a count above its limit: fewer triangles do not shorten the JSON of glTF, joined parts do.
fn cure_of_excess(what: &str) -> &'static str {
    match what {
        "bytes of JSON" | "objects in JSON" | "primitives" => {
            "Join the parts into one mesh, for example with gltf-transform join"
        }
        _ => "Simplify (decimate) the mesh",
    }
}

impl MeshError {
    /// Code for programs: `size_required`, or `invalid_mesh`.
    pub fn code(&self) -> &'static str {
        match self {
            Self::SizeRequired { .. } => "size_required",
            _ => "invalid_mesh",
        }
    }

    /// The two sentences of the message, without full stops: what is wrong, and what helps.
    pub fn cause_and_hint(&self) -> (String, String) {
        let message = self.to_string();
        let (cause, hint) = message.rsplit_once(". ").unwrap_or((&message, "Try another file"));
        (cause.to_owned(), hint.to_owned())
    }
}
