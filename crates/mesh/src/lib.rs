//! Triangle meshes: parsing, repair, units, mass properties, stable poses and convex decomposition.
//!
//! In: the untrusted bytes of a file in one of the [`FORMATS`]. Out: a [`Mesh`] in metres, with a
//! report of repairs and assumptions. Independent of file names and physics engines.
//!
//! Start with [`import`]: it parses, repairs and scales. Then, on the imported mesh:
//!
//! - [`solid_properties`]: volume, centre of mass and inertia
//! - [`stable_poses`]: the faces on which the object can rest on a table
//! - [`decompose`]: convex parts, because physics engines collide convex shapes only
//!
//! The mesh frame is the frame of the file's coordinates. glTF is converted to z up, and so is a file whose up
//! axis is given. The centre of a mesh far from the origin is subtracted.

mod convex_decomposition;
mod convex_hull;
mod error;
mod imported_mesh;
mod io;
mod mass_properties;
mod options;
mod overlap;
mod repair;
mod simplify;
mod solid;
mod stable_pose;
mod summary;
#[cfg(test)]
mod test_meshes;
mod unit;
mod up_axis;

pub use convex_decomposition::{ConvexDecomposition, Method, decompose};
pub use convex_hull::convex_hull;
pub use error::{Location, MeshError};
pub use imported_mesh::ImportedMesh;
pub use io::{
    ExternalFiles, FORMATS, MAX_BYTES, MAX_TRIANGLES, MeshFormat, NO_EXTERNAL_FILES, format_list,
    read, read_with_files,
};
pub use mass_properties::{MassProperties, VolumeSource, mass_properties};
pub use options::{MeshOptions, UpAxis};
pub use repair::{RepairReport, repair};
pub use simplify::SimplifyReport;
pub use solid::solid_properties;
pub use stable_pose::{StablePose, is_stable, stable_poses};
pub use summary::MeshSummary;
pub use unit::{ResolvedUnit, Unit};

use glamx::Vec3;

/// Indexed triangle mesh; in metres after [`import`], in the units of the file after [`read`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions (m or units of the file), mesh frame.
    pub vertices: Vec<Vec3>,
    /// Corner indices into `vertices`, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Accepted length (m) of the longest side of the bounding box.
const SIZE_RANGE_M: std::ops::RangeInclusive<f32> = 0.001..=10.0;

/// Max number of triangles; [`import`] simplifies a larger mesh to at most this number before all other steps.
pub const SIMPLIFY_ABOVE_TRIANGLES: usize = 1_000_000;

/// Parses, simplifies, repairs and scales a mesh to metres, z up.
///
/// Fails if the file is not a valid mesh, if its size is not certain, or if its longest side is outside 1 mm to
/// 10 m.
///
/// ```rust
/// use mesh::{MeshOptions, Unit};
/// // OBJ stores no unit. A side of 120 units suits an object of 120 mm.
/// let obj = b"v 0 0 0\nv 60 0 0\nv 0 40 0\nv 0 0 120\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
/// let imported = mesh::import(obj, &MeshOptions::default())?;
/// assert_eq!(imported.unit.unit, Unit::Millimetre);
/// assert!(imported.repair.watertight);
/// // The volume of the tetrahedron is 60 x 40 x 120 / 6 mm³ = 48 cm³.
/// let properties = mesh::solid_properties(&imported.mesh, imported.repair.watertight)?;
/// assert!((properties.volume - 48e-6).abs() < 1e-9); // m³
/// // The size can be given instead.
/// let options = MeshOptions { size: Some(0.24), ..MeshOptions::default() }; // m
/// assert!((mesh::import(obj, &options)?.mesh.extent().z - 0.24).abs() < 1e-6);
/// # Ok::<(), mesh::MeshError>(())
/// ```
pub fn import(bytes: &[u8], options: &MeshOptions) -> Result<ImportedMesh, MeshError> {
    import_with_files(bytes, options, NO_EXTERNAL_FILES)
}

/// [`import`] for a glTF file with its buffers in other files.
pub fn import_with_files(
    bytes: &[u8],
    options: &MeshOptions,
    files: &ExternalFiles,
) -> Result<ImportedMesh, MeshError> {
    let (mesh, format) = io::read_format(bytes, files)?;
    let mesh = match (options.up, format.up) {
        // glTF is converted from y up to z up by its parser.
        (Some(up), Some(UpAxis::Y)) => up.to_z(UpAxis::Y.z_to_axis(mesh)),
        (Some(up), _) => up.to_z(mesh),
        (None, _) => mesh,
    };
    let (mesh, simplified) = match mesh.triangles.len() > SIMPLIFY_ABOVE_TRIANGLES {
        true => {
            let (mesh, simplified) = simplify::simplify(&mesh, SIMPLIFY_ABOVE_TRIANGLES);
            (mesh, Some(simplified))
        }
        false => (mesh, None),
    };
    let (mesh, repair) = repair(mesh)?;
    let unit = unit::resolve_unit(mesh.extent().max_element(), format.unit, options)?;
    let metres = unit.metres_per_unit;
    let has_no_axis = options.up.is_none() && format.up.is_none();
    let is_y_up = has_no_axis && (up_axis::is_y_up(&mesh) || up_axis::is_normalized(&mesh));
    let mesh = mesh.scaled(metres);
    let simplified =
        simplified.map(|s| SimplifyReport { max_displacement: s.max_displacement * metres, ..s });
    let longest = mesh.extent().max_element();
    if !SIZE_RANGE_M.contains(&longest) {
        return Err(MeshError::SizeOutOfRange { longest, unit: unit.unit });
    }
    Ok(ImportedMesh { mesh, unit, repair, simplified, is_y_up })
}

impl Mesh {
    /// Min and max corner of the axis-aligned bounding box (unit of the vertices); both are the origin if
    /// there are no vertices.
    pub fn bounds(&self) -> [Vec3; 2] {
        bounds(&self.vertices)
    }

    /// Extents of the bounding box along x, y and z (unit of the vertices).
    pub fn extent(&self) -> Vec3 {
        let [low, high] = self.bounds();
        high - low
    }

    /// Translation (unit of the vertices) that moves the bottom of the bounding box to z = 0 and its centre
    /// to x = y = 0.
    pub fn offset_to_ground(&self) -> Vec3 {
        let [low, high] = self.bounds();
        let center = 0.5 * (low + high);
        -Vec3::new(center.x, center.y, low.z)
    }

    /// The mesh with each coordinate multiplied by `factor` (> 0).
    pub fn scaled(mut self, factor: f32) -> Self {
        self.vertices.iter_mut().for_each(|v| *v *= factor);
        self
    }

    /// The mesh translated by `offset` (unit of the vertices).
    pub fn translated(mut self, offset: Vec3) -> Self {
        self.vertices.iter_mut().for_each(|v| *v += offset);
        self
    }
}

/// Min and max corner of the bounding box of points; both are the origin if there are none.
fn bounds(points: &[Vec3]) -> [Vec3; 2] {
    let Some(&first) = points.first() else { return [Vec3::ZERO; 2] };
    points.iter().fold([first; 2], |[low, high], &p| [low.min(p), high.max(p)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_follow_scaling_and_translation() {
        let mesh = test_meshes::cube().scaled(2.0).translated(Vec3::new(1.0, 0.0, -1.0));
        assert_eq!(mesh.bounds(), [Vec3::new(1.0, 0.0, -1.0), Vec3::new(3.0, 2.0, 1.0)]);
        assert_eq!(mesh.extent(), Vec3::splat(2.0));
        assert_eq!(Mesh::default().bounds(), [Vec3::ZERO; 2]);
    }

    #[test]
    fn import_scales_to_metres_and_keeps_the_position() {
        let cube = test_meshes::cube().scaled(80.0).translated(Vec3::new(0.0, 0.0, 500.0));
        let import = import(&test_meshes::obj(&cube), &MeshOptions::default()).unwrap();
        assert_eq!(import.unit.unit, Unit::Millimetre);
        assert!(import.repair.watertight);
        let [low, high] = import.mesh.bounds();
        assert!((low.z - 0.5).abs() < 1e-6 && (high.z - 0.58).abs() < 1e-6, "{low} {high}");
    }

    #[test]
    fn import_rejects_a_mesh_of_implausible_size() {
        let bytes = test_meshes::obj(&test_meshes::cube().scaled(80.0));
        let metres = MeshOptions { unit: Some(Unit::Metre), ..MeshOptions::default() };
        let error = import(&bytes, &metres).unwrap_err();
        assert_eq!(error, MeshError::SizeOutOfRange { longest: 80.0, unit: Unit::Metre });
        assert!(error.to_string().contains("80 m"), "{error}");
    }

    /// The YCB scans are not in the repository; `NGF_SCANS` names their folder.
    #[test]
    fn scans_are_watertight_and_have_the_size_of_the_objects() {
        let Ok(folder) = std::env::var("NGF_SCANS") else {
            println!("skipped: NGF_SCANS is not set");
            return;
        };
        let mut num_scans = 0;
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|e| e != "obj") {
                continue;
            }
            let bytes = std::fs::read(&path).unwrap();
            let import = import(&bytes, &MeshOptions::default()).unwrap();
            assert!(import.repair.watertight, "{path:?}: {:?}", import.repair);
            assert_eq!(import.unit.unit, Unit::Metre, "{path:?}");
            let source = solid_properties(&import.mesh, true).unwrap().source;
            assert_eq!(source, VolumeSource::Surface, "{path:?}");
            let parts = decompose(&import.mesh);
            println!("{path:?}: {:?}, {} parts", parts.method, parts.hulls.len());
            assert!(parts.hulls.len() <= convex_decomposition::MAX_PARTS, "{path:?}");
            if path.ends_with("004_sugar_box.obj") {
                let mut sides = import.mesh.extent().to_array().map(|x| x * 1000.0);
                sides.sort_by(f32::total_cmp);
                let wanted = [49.5, 94.2, 176.0];
                let near = sides.iter().zip(wanted).all(|(got, want)| (got - want).abs() < 1.0);
                assert!(near, "wanted {wanted:?} mm, got {sides:?}");
            }
            num_scans += 1;
        }
        assert!(num_scans > 0, "no *.obj in {folder}");
    }
}
